# The headers that most sources include are compiled once for many targets. clang spends most of the time of a source on
# parsing them: an unoptimised build takes half the time. gcc at -O3 gains 3 % and then warns of code in the standard
# library, so its builds precompile headers for tests only. A source still includes what it uses: tests/architecture
# checks that.
find_package(Eigen3 REQUIRED)
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/precompiled.cpp CONTENT "")

# Precompiles the headers, and others that are given, for targets with the same compile options.
function(cairn_precompiled name)
  cmake_parse_arguments(arg "" "" "HEADERS;LIBS;OPTIONS" ${ARGN})
  add_library(${name} OBJECT ${CMAKE_BINARY_DIR}/precompiled.cpp)
  target_link_libraries(${name} PRIVATE cairn_warnings Eigen3::Eigen ${arg_LIBS})
  target_precompile_headers(${name} PRIVATE <Eigen/Core> <Eigen/Dense> <algorithm> <array> <chrono> <cmath> <filesystem>
    <functional> <map> <memory> <optional> <set> <span> <sstream> <string> <string_view> <thread> <utility> <variant>
    <vector> ${arg_HEADERS})
  target_compile_options(${name} PRIVATE ${arg_OPTIONS})
endfunction()

if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  return()
endif()
cairn_precompiled(cairn_precompiled)
if(NOT CAIRN_SANITIZE)
  # clang takes a precompiled header only for sources with the same options.
  cairn_precompiled(cairn_precompiled_shared)
  cairn_position_independent(cairn_precompiled_shared)
endif()
set(computing cairn_common cairn_maps cairn_sim cairn_known_map ${CAIRN_SLAM_ROOMS})
if(CAIRN_SANITIZE)
  cairn_precompiled(cairn_precompiled_computing OPTIONS ${CAIRN_COMPUTING_OPTIONS})
endif()
set(folders common common/bag server server/slam server/store server/tools client/sim)
if(CAIRN_WITH_DDS)
  list(APPEND folders common/http common/wire client/lib client/cli client/web)
endif()
foreach(folder ${folders})
  get_property(targets DIRECTORY ${CMAKE_SOURCE_DIR}/${folder} PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target ${targets})
    get_target_property(type ${target} TYPE)
    if(NOT type MATCHES "^(STATIC_LIBRARY|EXECUTABLE)$")
      continue()
    endif()
    get_target_property(shared ${target} POSITION_INDEPENDENT_CODE)
    if(CAIRN_SANITIZE AND target IN_LIST computing)
      target_compile_options(${target} PRIVATE ${CAIRN_COMPUTING_OPTIONS})
      target_precompile_headers(${target} REUSE_FROM cairn_precompiled_computing)
    elseif(shared)
      target_precompile_headers(${target} REUSE_FROM cairn_precompiled_shared)
    else()
      target_precompile_headers(${target} REUSE_FROM cairn_precompiled)
    endif()
  endforeach()
endforeach()
