"""The commands, one file each: its function in Python with its result, and its command line.

`program` puts the command lines together, `command` makes them of functions and options, `console` prints.
"""
