"""A change of the code of a shared library, whose interface stays the same, links no dependent again."""
