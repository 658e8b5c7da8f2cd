from golden_msgs.msg._reading import Reading as Reading
