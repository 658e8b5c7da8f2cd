"""Interface definitions in OMG IDL 4.2: parse .idl files. The core writes them."""
