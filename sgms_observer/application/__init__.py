"""The work of the commands: functions that command line, nodes and fleet call."""
