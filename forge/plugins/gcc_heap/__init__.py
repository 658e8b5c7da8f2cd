"""Makes GCC collect garbage less often while the machine has memory for all compilers."""
