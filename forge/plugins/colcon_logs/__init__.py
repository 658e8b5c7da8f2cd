"""The log files of all packages that colcon's tools read: `events.log` and `logger_all.log`."""
