from golden_msgs.srv._calibrate import Calibrate as Calibrate
