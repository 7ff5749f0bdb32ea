"""Surfaces from files: numpy arrays, text matrices, point lists, instruments' formats.

* `content`: what a file holds, with its units, and numpy's own files.
* `text`: matrices, exported images and point lists.
* `reading`: finds the format of a file, reads and prepares it.
"""
