# For find_package(cairn): what the headers of the client library include, and the target cairn::client.
include(CMakeFindDependencyMacro)
find_dependency(Eigen3)
find_dependency(Threads)
include(${CMAKE_CURRENT_LIST_DIR}/cairn-targets.cmake)
