"""What every node needs: start and end, the master, work for one thread, RViz."""
