"""Single-axis machines whose contact is not Maxwell-slip: the truth with which the diagnosis is tested.

``machine.draw`` draws a machine, ``recording.record`` makes a recording of it, ``bag.write_bag`` and
``owner.write_yaml`` write what the diagnosis may see. Nothing here uses the formulas of the observer or its catalogue.
"""
