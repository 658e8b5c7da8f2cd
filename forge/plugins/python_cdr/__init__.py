"""Serializers in Python: code that packs and unpacks the fields of each message class by `struct`."""
