"""What a run found, and how it is read back: load steps, contacts, fields, error bars, accuracy.

`figures` draws it.
"""
