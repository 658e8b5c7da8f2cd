"""`forge lsp`: a language server for interface definitions and package.xml.

`server` speaks the protocol; all other modules are functions of an `Index`. May import `base`, `interfaces`,
`environment` and `workspace`. Needs the extra `lsp`, and is imported by no other command.
"""
