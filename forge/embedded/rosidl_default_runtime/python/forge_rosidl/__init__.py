"""The run time of forge's generated Python messages: base classes and checks of fields.

messages    base classes and metaclasses of messages, services and actions
checks      checks of field values
empty       empty arrays, the default of sequences of numbers
arrays      checks of fixed-size numeric arrays; the only module that imports numpy
"""
