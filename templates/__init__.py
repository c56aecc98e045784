"""Templates of the generated C and of its CMake package: files to be read, no code. Installed inside the package."""
