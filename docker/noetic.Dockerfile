# The suite on Ubuntu 20.04 with ROS Noetic, in a catkin workspace:
# docker build -f docker/noetic.Dockerfile -t atom:noetic .
# What is installed stands in requirements/apt_noetic.txt. The simulator is not in it: its mujoco
# (PyPI) is another one for Noetic's Python 3.8.
FROM ros:noetic-ros-core-focal

COPY requirements/apt_noetic.txt /tmp/
RUN apt-get update \
    && sed 's/#.*//' /tmp/apt_noetic.txt \
        | DEBIAN_FRONTEND=noninteractive xargs apt-get install --yes --no-install-recommends \
    && rm -rf /var/lib/apt/lists/*

SHELL ["/bin/bash", "-c"]
WORKDIR /catkin_ws
COPY . src/atom
RUN source src/atom/env.bash \
    && catkin_make -DCMAKE_BUILD_TYPE=Release \
    && source src/atom/env.bash \
    && rospack find atom_rviz_plugins \
    && python3 -m atom_core --help

ENTRYPOINT ["/bin/bash", "-c", "source /catkin_ws/src/atom/env.bash && exec \"$@\"", "atom"]
CMD ["bash"]
