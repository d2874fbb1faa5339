"""ROS messages to the types of the core and back; nothing here needs a master."""
