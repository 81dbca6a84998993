# Run by `cmake --install`. Installs the unit of the page for the prefix of this call (--prefix, DESTDIR).
set(bindir ${CMAKE_INSTALL_PREFIX}/bin)
set(docdir ${CMAKE_INSTALL_PREFIX}/share/doc/cairn-web)
set(unit $ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/lib/systemd/system/cairn-web.service)
message(STATUS "Installing: ${unit}")
configure_file(${CMAKE_CURRENT_LIST_DIR}/cairn-web.service.in ${unit} @ONLY)
file(CHMOD ${unit} PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
