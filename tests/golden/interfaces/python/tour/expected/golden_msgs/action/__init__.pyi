from golden_msgs.action._watch import Watch as Watch
