# For find_package(cairn): what the client library links, and the target cairn::client.
include(CMakeFindDependencyMacro)
list(PREPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR})  # FindOpenCV.cmake
find_dependency(OpenCV COMPONENTS core imgproc imgcodecs)
list(POP_FRONT CMAKE_MODULE_PATH)
foreach(package IN ITEMS Eigen3 PNG OpenSSL Threads fastcdr fastrtps fmt yaml-cpp)
  find_dependency(${package})
endforeach()
include(${CMAKE_CURRENT_LIST_DIR}/cairn-targets.cmake)
