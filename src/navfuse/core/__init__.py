"""Pure mathematics in compiled kernels: floats and arrays in and out, no classes, no checks, no input or output."""
