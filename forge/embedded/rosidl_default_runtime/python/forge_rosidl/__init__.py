"""What forge's generated Python messages share: their base classes and the checks of their fields.

messages    base classes and metaclasses of messages, services and actions
checks      what a field accepts
arrays      the same for fixed-size numeric arrays; the one module that imports numpy
"""
