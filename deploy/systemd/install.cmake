# Run by `cmake --install`. Installs the server's unit and its configuration for the prefix of this call (--prefix,
# DESTDIR).
set(bindir ${CMAKE_INSTALL_PREFIX}/bin)
set(docdir ${CMAKE_INSTALL_PREFIX}/share/doc/cairn-server)
set(sysconfdir ${CMAKE_INSTALL_PREFIX}/etc)
if(CMAKE_INSTALL_PREFIX STREQUAL "/usr")
  set(sysconfdir /etc)
endif()

# An existing configuration is kept; the defaults of this version are then installed beside it.
set(name cairnd.yaml)
if(EXISTS $ENV{DESTDIR}${sysconfdir}/cairn/cairnd.yaml)
  set(name cairnd.yaml.default)
endif()
file(INSTALL ${CMAKE_CURRENT_LIST_DIR}/../cairnd.yaml DESTINATION ${sysconfdir}/cairn RENAME ${name})
# The service's user must be able to read the configuration, whatever the umask of root is.
file(CHMOD $ENV{DESTDIR}${sysconfdir}/cairn PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(unit $ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/lib/systemd/system/cairnd.service)
message(STATUS "Installing: ${unit}")
configure_file(${CMAKE_CURRENT_LIST_DIR}/cairnd.service.in ${unit} @ONLY)
file(CHMOD ${unit} PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
