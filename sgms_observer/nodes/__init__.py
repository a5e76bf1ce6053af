"""The shell on the ROS graph: nodes, recorder, player. Beside the commands the one folder that imports ROS."""
