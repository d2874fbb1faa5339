# The suite on Debian 12, built and tried: docker build -f docker/debian12.Dockerfile -t atom .
# What is installed stands in requirements/ (apt.txt, pip.txt, constraints.txt).
FROM debian:12

RUN apt-get update \
    && apt-get install --yes --no-install-recommends make \
    && rm -rf /var/lib/apt/lists/*

# What changes seldom comes first: a change in the sources does not install everything again.
WORKDIR /atom
COPY Makefile ./
COPY requirements requirements
RUN make setup && rm -rf /var/lib/apt/lists/*

COPY . .
RUN make build \
    && bash -c 'source ./env.bash && rospack find atom_rviz_plugins && python3 -m atom_core --help'

SHELL ["/bin/bash", "-c"]
ENTRYPOINT ["/bin/bash", "-c", "source /atom/env.bash && exec \"$@\"", "atom"]
CMD ["bash"]
