"""Recordings in and out: rosbag2 folders in MCAP and sqlite3, and logs of drives and MATLAB made into them."""
