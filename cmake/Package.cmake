# What the packages hold besides the program and the library (docs/packages.md): components of `cmake --install`, and of
# CPack's Debian packages. tools/package calls it.

# Manual pages and completions, written by the program itself. A sanitized or a fuzzed one is not for installing.
set(BERTH_SHELL ${PROJECT_BINARY_DIR}/shell)
if(NOT BERTH_SANITIZE AND NOT BERTH_FUZZ)
  add_custom_command(OUTPUT ${BERTH_SHELL}/made
    COMMAND ${CMAKE_COMMAND} -E rm -rf ${BERTH_SHELL}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${BERTH_SHELL}
    COMMAND berth man --all ${BERTH_SHELL}/man1
    COMMAND berth completion bash > ${BERTH_SHELL}/berth
    COMMAND berth completion zsh > ${BERTH_SHELL}/_berth
    COMMAND berth completion fish > ${BERTH_SHELL}/berth.fish
    COMMAND ${CMAKE_COMMAND} -E touch ${BERTH_SHELL}/made
    DEPENDS berth VERBATIM)
  add_custom_target(berth_shell ALL DEPENDS ${BERTH_SHELL}/made)
endif()

set(from ${PROJECT_SOURCE_DIR}/packaging)
install(DIRECTORY ${BERTH_SHELL}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT program
  FILES_MATCHING PATTERN "*.1")
install(FILES ${BERTH_SHELL}/berth DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
  COMPONENT program OPTIONAL)
install(FILES ${BERTH_SHELL}/_berth DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions
  COMPONENT program OPTIONAL)
install(FILES ${BERTH_SHELL}/berth.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d
  COMPONENT program OPTIONAL)

if(BERTH_STUDIO AND NOT BERTH_PORTABLE)
  install(FILES ${from}/desktop/org.berth_canopen.Studio.desktop
    DESTINATION ${CMAKE_INSTALL_DATADIR}/applications COMPONENT program)
  install(FILES ${from}/desktop/org.berth_canopen.Studio.metainfo.xml
    DESTINATION ${CMAKE_INSTALL_DATADIR}/metainfo COMPONENT program)
  install(PROGRAMS ${from}/desktop/studio-desktop DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/berth COMPONENT program)
  install(FILES ${PROJECT_SOURCE_DIR}/web/public/icon.svg RENAME berth.svg
    DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps COMPONENT program)
endif()

# They name paths of the system, so they are for its own prefix alone.
if(CMAKE_INSTALL_PREFIX STREQUAL "/usr" AND NOT BERTH_PORTABLE)
  install(FILES ${from}/udev/78-berth.rules DESTINATION lib/udev/rules.d COMPONENT program)
  install(FILES ${from}/systemd/berth@.service DESTINATION lib/systemd/system COMPONENT program)
  install(FILES ${from}/systemd/berth.sysusers.conf RENAME berth.conf DESTINATION lib/sysusers.d COMPONENT program)
  # Machine files come here.
  install(DIRECTORY DESTINATION /etc/berth COMPONENT program)
endif()

# examples/ without what only the build uses; docs/ whole, with its pictures.
set(doc ${CMAKE_INSTALL_DATADIR}/doc/berth)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/ DESTINATION ${doc} COMPONENT documentation)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples DESTINATION ${doc} COMPONENT documentation)
install(FILES ${PROJECT_SOURCE_DIR}/README.md DESTINATION ${doc} COMPONENT documentation)

# ---- Debian packages ----

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME berth)
set(CPACK_PACKAGE_VENDOR "The Berth developers")
set(CPACK_PACKAGE_CONTACT "The Berth developers <berth@localhost>")
set(CPACK_PACKAGING_INSTALL_PREFIX ${CMAKE_INSTALL_PREFIX})
set(CPACK_OUTPUT_FILE_PREFIX packages)
set(CPACK_COMPONENTS_ALL program development documentation)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
  WORLD_READ WORLD_EXECUTE)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/packaging/debian/finish.cmake)
set(CPACK_BERTH_PACKAGING ${from})

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME berth)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION electronics)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
# For the account of the service.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "systemd | systemd-standalone-sysusers | systemd-sysusers")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "iproute2")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "berth-doc, can-utils, xdg-utils")
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "commissions and runs CANopen networks
Berth finds the devices of a CANopen machine, gives each the node-ID of its
slot, configures, starts and watches it, and puts a replacement to work. The
machine is a text file; the same file runs on real buses (SocketCAN, serial
adapters) and on a built-in simulated one.

Studio, its web pages, is built in: berth studio.")

# Static libraries only, so there is no package of shared ones: the interface changes with each version, and what a
# room's inline functions and templates put into a program would not be replaced with a shared library.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libberth-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
string(JOIN ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS libexpected-dev libfmt-dev liblua5.4-dev libmosquitto-dev
  libprotobuf-dev libpugixml-dev libsqlite3-dev libsqlitecpp-dev libssl-dev libtomlplusplus-dev nlohmann-json3-dev
  zlib1g-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "berth-doc, cmake")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "CANopen devices and masters in C++: headers and static libraries
A C++20 library for CANopen: devices, clients, network boot-up, LSS, SDO, PDO,
device descriptions, a bit-exact simulated bus. One static library for each
room, as CMake package Berth: find_package(Berth COMPONENTS client io).")

set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_NAME berth-doc)
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_SECTION doc)
set(CPACK_DEBIAN_DOCUMENTATION_PACKAGE_ARCHITECTURE all)
set(CPACK_COMPONENT_DOCUMENTATION_DESCRIPTION "commissions and runs CANopen networks - documentation
The manual of Berth, and its examples: machine files, simulated plants, device
descriptions, and programs that use the library.")

foreach(kind postinst prerm postrm)
  list(APPEND CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA ${from}/debian/${kind})
endforeach()
include(CPack)
