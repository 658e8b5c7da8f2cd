"""What people look at: the graph of a workspace, and where the time of a build went.

Pages and drawings are readers: of the graph, and of the events that every build leaves in its log.
"""
