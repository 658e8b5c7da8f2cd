include("${gate_DIR}/configure_gate_library.cmake")
include("${gate_DIR}/get_gates.cmake")
