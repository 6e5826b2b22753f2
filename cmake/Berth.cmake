# One target per room, linked as berth/floors.txt says. Sources are found by folder: a new file needs no edit here.

add_library(berth_options INTERFACE)
target_compile_options(berth_options INTERFACE
  -Wall -Wextra -Wpedantic -Werror -Wconversion -Wno-sign-conversion -Wcast-qual -Wundef
  "$<$<COMPILE_LANGUAGE:CXX>:-Wdelete-non-virtual-dtor;-Wold-style-cast;-Woverloaded-virtual>")
# A unit of several sources is no source: what stands in its anonymous namespaces is used from no other, and a local name
# may be what another source calls something of its own. What is built without units sees both.
target_compile_options(berth_options INTERFACE
  $<IF:$<BOOL:$<TARGET_PROPERTY:UNITY_BUILD>>,-Wno-subobject-linkage,-Wshadow>)
# g++ 12 warns wrongly of uninitialised and out-of-bounds members inside inlined optionals, expecteds and strings.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(berth_options INTERFACE -Wno-maybe-uninitialized -Wno-restrict -Wno-stringop-overflow
    -Wno-array-bounds)
  # The compiler collects its garbage from 512 MB on, not from 128: an eighth of its time, for 100 MB more at most.
  target_compile_options(berth_options INTERFACE --param=ggc-min-heapsize=524288)
  # The C library marks what must not be ignored (`read`, `write`) for optimised builds alone, so a sanitized build would
  # accept what a release refuses.
  if(BERTH_SANITIZE)
    target_compile_definitions(berth_options INTERFACE "__wur=__attribute__((__warn_unused_result__))")
  endif()
endif()
if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  target_compile_options(berth_options INTERFACE -Wno-missing-designated-field-initializers -Wno-unknown-warning-option
    -Wno-unknown-pragmas)
endif()
target_include_directories(berth_options INTERFACE ${PROJECT_SOURCE_DIR})

# A program is linked in a tenth of the time by mold; what ships is linked by the system's linker.
find_program(BERTH_MOLD mold)
if(BERTH_MOLD AND BERTH_TESTS AND NOT BERTH_FUZZ)
  target_link_options(berth_options INTERFACE -fuse-ld=mold)
endif()

# Tests are linked with the sanitizer runtime but not instrumented: half of the time for what finds bugs in the product.
add_library(berth_sanitize INTERFACE)
add_library(berth_sanitize_link INTERFACE)
if(BERTH_SANITIZE)
  string(REPLACE "," ";" berth_sanitizers "${BERTH_SANITIZE}")
  foreach(which IN LISTS berth_sanitizers)
    if(which STREQUAL "undefined")
      # The half of UBSan that finds mistakes here; the rest (alignment, vptr, null) doubles the build for nothing.
      set(flags -fsanitize=bounds,shift,signed-integer-overflow,integer-divide-by-zero,bool,enum,return,unreachable
        -fno-sanitize-recover=all)
    else()
      set(flags -fsanitize=${which})
    endif()
    target_compile_options(berth_sanitize INTERFACE ${flags} -fno-omit-frame-pointer)
    target_link_options(berth_sanitize_link INTERFACE ${flags})
  endforeach()
  target_compile_definitions(berth_sanitize INTERFACE BERTH_SANITIZED=1)
endif()

# Sanitized code is optimised a little, else it would be too slow to test: the rooms that each frame passes, and that
# ./run faults and kill spend their time in, by -O1. The others read, write and print, once a command; their checks of
# addresses stand in calls, which finds the same and takes a third less to compile.
set(berth_every_frame base rt can sim od co lss nodeid device discovery harness)
function(berth_optimise_sanitized target room)
  if(NOT BERTH_SANITIZE)
    return()
  endif()
  if(room IN_LIST berth_every_frame OR BERTH_FUZZ)
    target_compile_options(${target} PRIVATE -O1)
    return()
  endif()
  target_compile_options(${target} PRIVATE -Og)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${target} PRIVATE --param=asan-instrumentation-with-call-threshold=0)
  endif()
endfunction()

# Without coverage of the product libFuzzer would only guess.
if(BERTH_FUZZ)
  target_compile_options(berth_sanitize INTERFACE -fsanitize=fuzzer-no-link)
  target_link_options(berth_sanitize_link INTERFACE -fsanitize=fuzzer-no-link)
endif()

# Many sources of one room, program or folder of tests in one unit: the standard library is read, and its templates are
# compiled, once for all of them. cmake/apart.txt names those that need a unit of their own. Sources with options of
# their own CMake leaves out.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/cmake/apart.txt)
file(STRINGS ${PROJECT_SOURCE_DIR}/cmake/apart.txt berth_apart REGEX "^[^#]")
function(berth_unity target most)
  if(NOT BERTH_UNITY OR (BERTH_UNITY STREQUAL "tests" AND NOT target MATCHES "^test_"))
    return()
  endif()
  get_target_property(sources ${target} SOURCES)
  set(index 0)
  foreach(source IN LISTS sources)
    file(RELATIVE_PATH path ${PROJECT_SOURCE_DIR} ${source})
    set(group "")
    foreach(line IN LISTS berth_apart)
      string(REPLACE " " ";" names "${line}")
      if(path IN_LIST names)
        list(GET names 0 first)
        string(MAKE_C_IDENTIFIER ${first} group)
      endif()
    endforeach()
    if(NOT group)
      math(EXPR group "${index} / ${most}")
      math(EXPR index "${index} + 1")
    endif()
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endfunction()

# The headers of the standard library are read once for all of the product, where several sources are one unit anyway:
# by each, they are a seventh of its time. Sanitized code has two optimisations, and the headers for each. Not at -O2,
# where g++ 12 warns wrongly of strings that it inlines from precompiled headers.
find_package(fmt REQUIRED)
find_package(tl-expected REQUIRED)
if(BERTH_PORTABLE)
  berth_archive(fmt::fmt berth_fmt)
endif()
function(berth_precompiled target room)
  if(NOT BERTH_PCH OR NOT BERTH_SANITIZE OR NOT BERTH_UNITY OR BERTH_UNITY STREQUAL "tests")
    return()
  endif()
  set(headers berth_headers)
  if(room IN_LIST berth_every_frame)
    set(headers berth_headers_of_every_frame)
  endif()
  if(NOT TARGET ${headers})
    add_library(${headers} OBJECT ${PROJECT_SOURCE_DIR}/cmake/empty.cpp)
    target_link_libraries(${headers} PRIVATE berth_options berth_sanitize fmt::fmt tl::expected)
    berth_optimise_sanitized(${headers} ${room})
    target_precompile_headers(${headers} PRIVATE ${PROJECT_SOURCE_DIR}/cmake/pch.hpp)
  endif()
  target_precompile_headers(${target} REUSE_FROM ${headers})
endfunction()

# The pages of Studio, compressed and as a source: web/dist when it was built (docs/api.md), else none.
function(berth_pages target)
  set(dist ${PROJECT_SOURCE_DIR}/web/dist)
  set(out ${PROJECT_BINARY_DIR}/studio)
  file(MAKE_DIRECTORY ${out})
  file(GLOB_RECURSE files CONFIGURE_DEPENDS RELATIVE ${dist} ${dist}/*)
  set(arrays "")
  set(table "")
  set(number 0)
  foreach(file IN LISTS files)
    set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${dist}/${file})
    file(ARCHIVE_CREATE OUTPUT ${out}/page.gz PATHS ${dist}/${file} FORMAT raw COMPRESSION GZip COMPRESSION_LEVEL 9)
    file(READ ${out}/page.gz bytes HEX)
    # Without the time of its making: the same page is the same source.
    string(SUBSTRING ${bytes} 0 8 begin)
    string(SUBSTRING ${bytes} 16 -1 rest)
    set(bytes ${begin}00000000${rest})
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
    string(APPEND arrays "constexpr unsigned char page_${number}[] = {${bytes}};\n")
    string(APPEND table "    {\"/${file}\", page_${number}, sizeof page_${number}},\n")
    math(EXPR number "${number} + 1")
  endforeach()
  if(number EQUAL 0)
    set(table "    {\"\", nullptr, 0},\n")
  endif()
  file(CONFIGURE OUTPUT ${out}/pages_built.cpp CONTENT "#include \"berth/studio/pages.hpp\"

namespace berth::studio {
namespace {

${arrays}
constexpr BuiltPage all[] = {
${table}};

}  // namespace

std::span<const BuiltPage> built_pages() noexcept { return std::span(all).first(${number}); }

}  // namespace berth::studio
" @ONLY)
  target_sources(${target} PRIVATE ${out}/pages_built.cpp)
endfunction()

# Files of examples/ that room `harness` has built in.
function(berth_example_data target)
  set(eds ${PROJECT_SOURCE_DIR}/examples/eds)
  set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${eds}/pump.eds ${eds}/pump.dcf)
  file(READ ${eds}/pump.eds pump_eds)
  file(READ ${eds}/pump.dcf pump_dcf)
  configure_file(${PROJECT_SOURCE_DIR}/berth/harness/example_data.cpp.in ${PROJECT_BINARY_DIR}/harness/example_data.cpp
    @ONLY)
  target_sources(${target} PRIVATE ${PROJECT_BINARY_DIR}/harness/example_data.cpp)
endfunction()

# The wire types of Sparkplug, generated into the build folder: at configuration, as ./run lint reads sources and builds
# nothing. They are no code of ours: compiled without our warnings, and seen by the sources of the room only.
function(berth_protobuf target name)
  find_package(Protobuf REQUIRED)
  set(out ${PROJECT_BINARY_DIR}/protobuf)
  set(folder ${PROJECT_SOURCE_DIR}/berth/sparkplug)
  set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${folder}/${name}.proto)
  file(MAKE_DIRECTORY ${out})
  if(${folder}/${name}.proto IS_NEWER_THAN ${out}/${name}.pb.cc)
    execute_process(COMMAND ${Protobuf_PROTOC_EXECUTABLE} --cpp_out=${out} --proto_path=${folder} ${name}.proto
      COMMAND_ERROR_IS_FATAL ANY)
  endif()
  set_source_files_properties(${out}/${name}.pb.cc PROPERTIES COMPILE_OPTIONS -w SKIP_UNITY_BUILD_INCLUSION ON
    SKIP_PRECOMPILE_HEADERS ON)
  target_sources(${target} PRIVATE ${out}/${name}.pb.cc)
  target_include_directories(${target} SYSTEM PRIVATE ${out} ${Protobuf_INCLUDE_DIRS})
  target_link_libraries(${target} PRIVATE protobuf::libprotobuf-lite)
endfunction()

function(berth_rooms)
  file(STRINGS ${PROJECT_SOURCE_DIR}/berth/floors.txt lines REGEX "^[0-9]")
  set(rooms "")
  foreach(line IN LISTS lines)
    string(REGEX MATCH "^[0-9]+ +([a-z]+) *:(.*)$" _ "${line}")
    set(room ${CMAKE_MATCH_1})
    separate_arguments(links UNIX_COMMAND "${CMAKE_MATCH_2}")
    if((room STREQUAL "studio" AND NOT BERTH_STUDIO) OR (room MATCHES "^(mqtt|fleet)$" AND NOT BERTH_MQTT))
      continue()
    endif()
    file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/berth/${room}/*.cpp)
    if(NOT sources)
      set(sources ${PROJECT_SOURCE_DIR}/cmake/empty.cpp)
    endif()
    add_library(berth_${room} STATIC ${sources})
    add_library(berth::${room} ALIAS berth_${room})
    berth_unity(berth_${room} 12)
    berth_optimise_sanitized(berth_${room} ${room})
    if(room STREQUAL "base" OR "base" IN_LIST links)  # the others do not know {fmt}
      berth_precompiled(berth_${room} ${room})
    endif()
    # Flags are for this build only, not for whoever uses the installed package.
    target_link_libraries(berth_${room} PRIVATE $<BUILD_INTERFACE:berth_sanitize>
      PUBLIC $<BUILD_INTERFACE:berth_options> $<BUILD_INTERFACE:berth_sanitize_link>)
    list(APPEND rooms ${room})
    set(BERTH_LINKS_${room} ${links} PARENT_SCOPE)
    foreach(link IN LISTS links)
      target_link_libraries(berth_${room} PUBLIC berth_${link})
    endforeach()
  endforeach()

  # All of it, for what tries the whole: tests that are no room's, fuzz targets, tools. Not installed.
  add_library(berth_house INTERFACE)
  foreach(room IN LISTS rooms)
    target_link_libraries(berth_house INTERFACE berth_${room})
  endforeach()

  # What each room needs from outside (docs/dependencies.md; cmake/BerthConfig.cmake.in has the same list).
  set(BERTH_ROOMS ${rooms} PARENT_SCOPE)
  target_link_libraries(berth_base PUBLIC fmt::fmt tl::expected)
  find_package(tomlplusplus REQUIRED)
  find_package(nlohmann_json REQUIRED)
  find_package(pugixml REQUIRED)
  set(pugixml pugixml::pugixml)
  if(BERTH_PORTABLE)
    berth_archive(tomlplusplus::tomlplusplus berth_toml)
    set(pugixml pugixml::static)
  endif()
  target_link_libraries(berth_eds PRIVATE ${pugixml})
  find_package(ZLIB REQUIRED)
  target_link_libraries(berth_base PRIVATE ZLIB::ZLIB)
  target_link_libraries(berth_manager PRIVATE ZLIB::ZLIB)
  target_link_libraries(berth_trace PRIVATE ZLIB::ZLIB)
  target_link_libraries(berth_text PRIVATE tomlplusplus::tomlplusplus)
  # Compiled as C++: its errors are exceptions, and destructors run.
  find_library(BERTH_LUA lua5.4-c++ REQUIRED)
  target_link_libraries(berth_script PRIVATE ${BERTH_LUA})
  find_package(SQLiteCpp REQUIRED)
  find_package(SQLite3 REQUIRED)
  target_link_libraries(berth_store PRIVATE SQLiteCpp SQLite::SQLite3)
  target_link_libraries(berth_operate PRIVATE nlohmann_json::nlohmann_json)
  target_link_libraries(berth_command PRIVATE nlohmann_json::nlohmann_json)
  target_link_libraries(berth_document PRIVATE nlohmann_json::nlohmann_json)
  berth_example_data(berth_harness)
  target_link_libraries(berth_campaign PRIVATE nlohmann_json::nlohmann_json)
  berth_protobuf(berth_sparkplug sparkplug_b)
  target_link_libraries(berth_sparkplug PRIVATE nlohmann_json::nlohmann_json)
  if(BERTH_MQTT)
    # In sources only; TLS is set up by OpenSSL itself, so that its errors can be told apart (mqtt/tls.hpp).
    find_path(BERTH_MOSQUITTO_HEADERS mosquitto.h REQUIRED)
    find_library(BERTH_MOSQUITTO mosquitto REQUIRED)
    find_package(OpenSSL REQUIRED COMPONENTS SSL)
    target_include_directories(berth_mqtt SYSTEM PRIVATE ${BERTH_MOSQUITTO_HEADERS})
    target_link_libraries(berth_mqtt PRIVATE ${BERTH_MOSQUITTO} OpenSSL::SSL)
    target_link_libraries(berth_fleet PRIVATE SQLiteCpp SQLite::SQLite3 nlohmann_json::nlohmann_json)
  endif()
  if(BERTH_STUDIO)
    # Headers only, and in sources only: whoever uses the room needs no Boost.
    find_path(BERTH_BOOST boost/beast.hpp REQUIRED)
    target_include_directories(berth_studio SYSTEM PRIVATE ${BERTH_BOOST})
    find_package(OpenSSL REQUIRED COMPONENTS SSL)
    target_link_libraries(berth_studio PRIVATE nlohmann_json::nlohmann_json OpenSSL::SSL)
    berth_pages(berth_studio)
    if(BERTH_SANITIZE MATCHES "thread")
      target_compile_options(berth_studio PRIVATE -Wno-tsan)  # Boost.Asio's fences, which tsan does not know
    endif()
  endif()
endfunction()
