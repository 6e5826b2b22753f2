# The program of the release archive (tools/release): it brings what a bare system does not have. What Debian has as a
# static library is linked so; {fmt} and toml++ are compiled from their headers; OpenSSL and libmosquitto, which uses
# OpenSSL itself, are shared ones in lib/ beside bin/. The C library is the system's: it finds names of hosts and users
# by modules of its own. The compiler is called as for the packages, so that ccache has its results.

list(PREPEND CMAKE_FIND_LIBRARY_SUFFIXES .a)
set(Protobuf_USE_STATIC_LIBS ON)
find_library(OPENSSL_SSL_LIBRARY libssl.so REQUIRED)
find_library(OPENSSL_CRYPTO_LIBRARY libcrypto.so REQUIRED)

add_library(berth_fmt STATIC cmake/portable/fmt.cpp)
add_library(berth_toml STATIC cmake/portable/toml.cpp)

# Called after find_package: the targets of these names give our archives instead of shared libraries.
function(berth_archive target archive)
  foreach(configuration "" _NONE _RELEASE)
    set_target_properties(${target} PROPERTIES
      IMPORTED_LOCATION${configuration} ${PROJECT_BINARY_DIR}/lib${archive}.a IMPORTED_SONAME${configuration} "")
  endforeach()
  add_dependencies(${target} ${archive})
  get_target_property(include ${target} INTERFACE_INCLUDE_DIRECTORIES)
  get_target_property(definitions ${target} INTERFACE_COMPILE_DEFINITIONS)
  get_target_property(options ${target} INTERFACE_COMPILE_OPTIONS)
  if(definitions)
    target_compile_definitions(${archive} PRIVATE ${definitions})
  endif()
  if(options)
    target_compile_options(${archive} PRIVATE ${options})
  endif()
endfunction()

function(berth_portable_program target)
  target_link_options(${target} PRIVATE -static-libstdc++ -static-libgcc)
  set_target_properties(${target} PROPERTIES INSTALL_RPATH "$ORIGIN/../lib")
endfunction()
