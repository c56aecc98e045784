"""Lower: from an `ImageProgram` to a `KernelProgram`, pass by pass; no pass changes a value beyond the bound it states."""
