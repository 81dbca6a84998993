# Coverage counters in the libraries that decode foreign bytes, so that libFuzzer sees which input reached new code. They
# are part of the asan build, because a second sanitized build of everything would take longer than their cost. Compilers
# other than clang have no libFuzzer: CAIRN_LIBFUZZER is off there, and only the replay of kept inputs is built.
set(CAIRN_LIBFUZZER OFF)
if(CAIRN_SANITIZE MATCHES address AND CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  set(CAIRN_LIBFUZZER ON)
  set(CAIRN_FUZZ_GUIDED -fsanitize-coverage=inline-8bit-counters,pc-table,trace-cmp)
  set(guided cairn_bag cairn_common cairn_sim cairn_known_map cairn_store cairn_records cairn_maps cairn_robots cairn_jobs
    cairn_queries cairn_server)
  if(CAIRN_WITH_DDS)
    list(APPEND guided cairn_idl cairn_wire cairn_client cairn_http cairn_web_page cairn_ros2 cairn_ros2_idl
      cairn_ros2_wire)
  endif()
  foreach(library ${guided})
    target_compile_options(${library} PRIVATE ${CAIRN_FUZZ_GUIDED})
  endforeach()
  # The estimator runs most of the time of all tests: it only counts, and does not report what it compares.
  foreach(room ${CAIRN_SLAM_ROOMS})
    target_compile_options(${room} PRIVATE -fsanitize-coverage=inline-8bit-counters,pc-table)
  endforeach()
endif()
