# CMake's own FindPython3, which remembers what it found. Where only the interpreter is asked for, CMake
# (3.28 to 4.1) writes down one property too many, "64;32" for "64", rejects its own note the next time,
# and starts Python six times again. sensor_msgs asks thirteen times.
if(DEFINED CACHE{_Python3_INTERPRETER_PROPERTIES})
  string(REPLACE ";64;32;" ";64;" _properties "${_Python3_INTERPRETER_PROPERTIES}")
  set(_Python3_INTERPRETER_PROPERTIES "${_properties}" CACHE INTERNAL "")
endif()
include("${CMAKE_ROOT}/Modules/FindPython3.cmake")
