"""`forge fetch`: locks and downloads the ROS packages that a workspace lacks, for `forge build` to build."""
