"""Lower: from an `ImageProgram` to a `KernelProgram`, by passes that change no value beyond the bound they state."""
