"""What forge's generated Python messages share: their base classes and the checks of their fields.

messages    base classes and metaclasses of messages, services and actions
checks      what a field accepts
empty       what sequences of numbers start as
arrays      the checks of fixed-size numeric arrays; the one module that imports numpy
"""
