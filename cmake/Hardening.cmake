# What a program that reads bytes from a bus, a network and files of others is built with, in each build type that ships:
# a mistake that is there all the same ends the program, and is no way into it. Sanitizers bring checks of their own.
# tools/check-hardening reads from a program whether it has them. The figures beside a build without them:
# ./run bench hardening.
option(BERTH_HARDEN "Build what ships with the compiler's and the linker's protections" ON)
if(NOT BERTH_HARDEN OR BERTH_SANITIZE OR BERTH_FUZZ)
  return()
endif()

include(CheckCXXCompilerFlag)
include(CheckCXXSourceCompiles)
include(CheckLinkerFlag)

set(berth_ships CONFIG:Release,RelWithDebInfo,MinSizeRel)

# Not CMAKE_POSITION_INDEPENDENT_CODE: that compiles static libraries for use in shared ones, where another may define
# each function anew, and the compiler inlines none of them.
add_compile_options($<$<${berth_ships}>:-fPIE>)
add_link_options($<$<${berth_ships}>:-pie>)

foreach(flag -fstack-protector-strong -fstack-clash-protection -fcf-protection -ftrivial-auto-var-init=zero)
  string(MAKE_C_IDENTIFIER "BERTH_HAS${flag}" has)
  check_cxx_compiler_flag(${flag} ${has})
  if(${has})
    add_compile_options($<$<${berth_ships}>:${flag}>)
  endif()
endforeach()

# An old C library takes 2 at most, and warns.
set(CMAKE_REQUIRED_FLAGS "-O2 -Werror -U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3")
check_cxx_source_compiles("#include <cstring>\nint main(int n, char** v) { return std::strlen(v[n - 1]) == 0; }"
  BERTH_FORTIFIES_3)
unset(CMAKE_REQUIRED_FLAGS)
set(level 2)
if(BERTH_FORTIFIES_3)
  set(level 3)
endif()
add_compile_options($<$<${berth_ships}>:-U_FORTIFY_SOURCE> $<$<${berth_ships}>:-D_FORTIFY_SOURCE=${level}>)

foreach(flag -Wl,-z,relro -Wl,-z,now -Wl,-z,noexecstack)
  string(MAKE_C_IDENTIFIER "BERTH_LINKS${flag}" links)
  check_linker_flag(CXX ${flag} ${links})
  if(${links})
    add_link_options($<$<${berth_ships}>:${flag}>)
  endif()
endforeach()
