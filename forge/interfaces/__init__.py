"""Interface definitions to code: parse, resolve, render, write; knows nothing of building."""
