# Debian packages, made by CPack from the components that deploy/CMakeLists.txt installs:
#   cairn-server   cairnd with its unit and its configuration, cairn-offline, cairn-calibrate
#   cairn-client   cairn: robots from logs, questions, maps, jobs
#   cairn-web      the page with the live map, with its unit
#   libcairn0.1    the client library; the number is that of its binary interface
#   libcairn-dev   its headers and find_package(cairn), with an example
# deploy/make-packages.sh builds them. What only a package needs (its copyright, its changelog) is left out of a plain
# `cmake --install`.
set(CAIRN_PACKAGES server client web library development)
set(server_package cairn-server)
set(client_package cairn-client)
set(web_package cairn-web)
set(library_package libcairn${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(development_package libcairn-dev)

# Pages for man(1), from what the programs say themselves: `cmake --build ... --target man_pages`. What is not built is
# not installed; without help2man, that is all but the pages of `cairn`.
find_program(HELP2MAN help2man)
set(pages)
function(cairn_man_page program section component name)
  set(page ${CMAKE_BINARY_DIR}/man/${program}.${section}.gz)
  install(FILES ${page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section} COMPONENT ${component} OPTIONAL)
  if(HELP2MAN AND TARGET ${program})
    add_custom_command(OUTPUT ${page} DEPENDS ${program} VERBATIM
      COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_BINARY_DIR}/man
      COMMAND sh -c "help2man --no-info --section=$2 --name=\"$3\" $4 \"$0\" | gzip -9n >\"$1\""
        $<TARGET_FILE:${program}> ${page} ${section} ${name} "${ARGN}")
    set(pages ${pages} ${page} PARENT_SCOPE)
  endif()
endfunction()
cairn_man_page(cairnd 8 server "mapping server for robot fleets")
cairn_man_page(cairn-offline 1 server "maps and trajectories from logs, without a server")
cairn_man_page(cairn-calibrate 1 server "wheels, mountings and motion models of a robot from its logs")
cairn_man_page(cairn-web 1 web "shows the mapping server cairnd in the browser")
# `cairn` writes its pages itself, one for each of its commands: help2man knows no commands of a program.
set(cairn_pages ${CMAKE_BINARY_DIR}/man/cairn)
install(DIRECTORY ${cairn_pages}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT client OPTIONAL
  FILES_MATCHING PATTERN "*.1.gz")
if(TARGET cairn)
  add_custom_command(OUTPUT ${cairn_pages}/cairn.1.gz DEPENDS cairn VERBATIM
    COMMAND ${CMAKE_COMMAND} -E rm -rf ${cairn_pages}
    COMMAND cairn --manual-pages ${cairn_pages}
    COMMAND sh -c "gzip -9n \"$0\"/*.1" ${cairn_pages})
  list(APPEND pages ${cairn_pages}/cairn.1.gz)
endif()
add_custom_target(man_pages DEPENDS ${pages})

set(changelog ${CMAKE_CURRENT_BINARY_DIR}/changelog.gz)
execute_process(COMMAND gzip -9nc ${CMAKE_CURRENT_LIST_DIR}/changelog OUTPUT_FILE ${changelog})
foreach(component IN LISTS CAIRN_PACKAGES)
  set(package ${${component}_package})
  install(FILES ${CMAKE_CURRENT_LIST_DIR}/copyright ${changelog}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME cairn)
set(CPACK_PACKAGE_CONTACT "Cairn maintainers <maintainers@cairn.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "mapping service for robot fleets")
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL ${CAIRN_PACKAGES})
set(CPACK_COMPONENTS_GROUPING IGNORE)
# The unit and the configuration name absolute paths.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
# For who links a shared library of these packages: dpkg-shlibdeps finds in it which package, and from which version on.
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")

# The scripts with which a package enables, starts, stops and forgets its service. `purge`: more that is deleted then.
function(cairn_service_scripts folder service purge)
  foreach(script IN ITEMS postinst prerm postrm)
    configure_file(${CMAKE_CURRENT_FUNCTION_LIST_DIR}/${script}.in ${folder}/${script} @ONLY)
    file(CHMOD ${folder}/${script} PERMISSIONS
      OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
  endforeach()
endfunction()

set(CPACK_DEBIAN_SERVER_PACKAGE_NAME cairn-server)
set(CPACK_DEBIAN_SERVER_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_SERVER_PACKAGE_SUGGESTS cairn-client)
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_STRICT_PERMISSION ON)
# The first folder is where systemd keeps the state of a service with a user of its own; the second is a link to it.
set(scripts ${CMAKE_CURRENT_BINARY_DIR}/debian/server)
cairn_service_scripts(${scripts} cairnd.service "  rm -rf /var/lib/private/cairn /var/lib/cairn
  rm -f /etc/cairn/cairnd.yaml.default
  rmdir /etc/cairn 2>/dev/null || true
")
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA
  ${CMAKE_CURRENT_LIST_DIR}/conffiles ${scripts}/postinst ${scripts}/prerm ${scripts}/postrm)
set(CPACK_COMPONENT_SERVER_DESCRIPTION "Robots stream 2D laser scans and odometry over DDS. The server keeps the SLAM
state and the maps of all of them, answers questions for poses and map tiles,
and smooths whole trajectories as jobs. Its state outlives it. Robots that run
ROS 2 are served as they are.

With cairn-offline, which makes maps and trajectories from logs, and
cairn-calibrate, which measures a robot from its logs. The first steps are in
/usr/share/doc/cairn-server/deploy/FIRST_HOUR.md.")
set(CPACK_DEBIAN_CLIENT_PACKAGE_NAME cairn-client)
set(CPACK_DEBIAN_CLIENT_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_CLIENT_DESCRIPTION "Client of the mapping server cairnd: replays logs and bags of ROS 2 as robots,
simulates robots, asks for poses, paths and maps, exports maps for Nav2, starts
jobs and edits sites. The first steps are in
/usr/share/doc/cairn-client/deploy/FIRST_HOUR.md.")
set(CPACK_DEBIAN_WEB_PACKAGE_NAME cairn-web)
set(CPACK_DEBIAN_WEB_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_WEB_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(scripts ${CMAKE_CURRENT_BINARY_DIR}/debian/web)
cairn_service_scripts(${scripts} cairn-web.service "")
set(CPACK_DEBIAN_WEB_PACKAGE_CONTROL_EXTRA ${scripts}/postinst ${scripts}/prerm ${scripts}/postrm)
set(CPACK_COMPONENT_WEB_DESCRIPTION "The mapping server cairnd in the browser: the live map with robots and their
paths, jobs, downloads of maps, and figures for Prometheus.")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME ${library_package})
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SHLIBDEPS ON)
# The trigger has dpkg run ldconfig. CPack would write scripts that do so, which Debian does not want any more, unless
# it is given some. These two do not exist: CPack says that they are missing, and the package has none.
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_LIST_DIR}/triggers
  ${CMAKE_CURRENT_LIST_DIR}/none/postinst ${CMAKE_CURRENT_LIST_DIR}/none/postrm)
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION "Client library of the mapping server cairnd, with which programs stream
scans to a server, ask questions and follow poses and maps.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libcairn-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "${library_package} (= ${PROJECT_VERSION}), libeigen3-dev, libexpected-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "cmake, cairn-server")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "What it takes to compile programs with the client library of the
mapping server cairnd: headers, find_package(cairn) for CMake, and a robot as
an example.")
include(CPack)
