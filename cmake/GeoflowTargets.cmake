# Compiler settings shared by every target, and the functions that declare a part, its tests and its fuzz targets.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_C_STANDARD 11)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_VERIFY_INTERFACE_HEADER_SETS ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

# Paths below the top are hashed as relative ones, so that all work trees share the cache; the sloppiness is what ccache
# asks for in order to cache precompiled headers and their users.
find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env "CCACHE_BASEDIR=${PROJECT_SOURCE_DIR}" CCACHE_NOHASHDIR=1
      CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime "${CCACHE_PROGRAM}")
  set(CMAKE_C_COMPILER_LAUNCHER "${CMAKE_CXX_COMPILER_LAUNCHER}")
endif()

find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt REQUIRED)
find_package(tl-expected REQUIRED)

add_library(geoflow_options INTERFACE)
target_compile_options(geoflow_options INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wold-style-cast -Wnon-virtual-dtor
  -Woverloaded-virtual -Wcast-align -Wnull-dereference -Wdouble-promotion -Werror
  -fno-math-errno -fstack-protector-strong
  $<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond;-Wlogical-op>
  $<$<CXX_COMPILER_ID:Clang>:-Wthread-safety>)
target_link_options(geoflow_options INTERFACE $<$<CXX_COMPILER_ID:Clang>:-fuse-ld=lld>)
# fmt 9 and GCC 12's optimiser disagree about null and array bounds inside inlined library code.
target_compile_options(geoflow_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-null-dereference>)
target_compile_definitions(geoflow_options INTERFACE
  $<$<CONFIG:Debug>:_GLIBCXX_ASSERTIONS;EIGEN_INITIALIZE_MATRICES_BY_NAN>)
if(GEOFLOW_SANITIZE)
  # Not vptr: it asks the kernel through a pipe whether an object is there, and without a free descriptor says it is not;
  # being out of descriptors is among the tests.
  target_compile_options(geoflow_options INTERFACE -fsanitize=${GEOFLOW_SANITIZE} -fno-sanitize=vptr
    -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(geoflow_options INTERFACE -fsanitize=${GEOFLOW_SANITIZE})
  target_compile_definitions(geoflow_options INTERFACE _GLIBCXX_ASSERTIONS)
else()
  target_compile_definitions(geoflow_options INTERFACE $<$<NOT:$<CONFIG:Debug>>:_FORTIFY_SOURCE=2>)
endif()

# What libFuzzer learns from: the parts' own code, not that of programs and tests around it.
set(geoflow_coverage $<$<BOOL:${GEOFLOW_FUZZ}>:-fsanitize=fuzzer-no-link>)

# What nearly every source includes; precompiled once per part. Sources still include all that they use: clang-tidy refuses
# one that does not.
set(geoflow_precompiled <Eigen/Core> <Eigen/Geometry> <fmt/format.h> <tl/expected.hpp> <algorithm> <chrono> <filesystem>
    <functional> <map> <memory> <optional> <string> <variant> <vector>)

# geoflow_part(NAME SOURCES … [DEPENDS …] [PRIVATE_DEPENDS …] [PRECOMPILE <header> …])
# A part is a static library geoflow_NAME with public headers in include/geoflow/NAME, checked to be self-contained.
# PRECOMPILE names the heavy third-party headers that several of its sources use.
function(geoflow_part name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS;PRECOMPILE" ${ARGN})
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/include/*.hpp"
       "${CMAKE_CURRENT_SOURCE_DIR}/include/*.h")
  add_library(geoflow_${name} STATIC ${ARG_SOURCES})
  target_sources(geoflow_${name} PUBLIC FILE_SET HEADERS BASE_DIRS include FILES ${headers})
  target_include_directories(geoflow_${name} PRIVATE "${CMAKE_CURRENT_SOURCE_DIR}")
  target_link_libraries(geoflow_${name} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS} geoflow_options)
  target_compile_options(geoflow_${name} PRIVATE ${geoflow_coverage})
  target_precompile_headers(geoflow_${name} PRIVATE ${geoflow_precompiled} ${ARG_PRECOMPILE})
  add_library(geoflow::${name} ALIAS geoflow_${name})
endfunction()

add_custom_target(slow_tests)
set(sanitized FALSE)
if(GEOFLOW_SANITIZE)
  set(sanitized TRUE)
endif()

# geoflow_test(NAME SOURCES … DEPENDS … [LABELS fast|slow …] [PRIVATE_OF part …])
# A GoogleTest program; PRIVATE_OF gives it the private headers of those parts. Its tests are labelled `fast` unless LABELS
# says otherwise, then with the name of their folder in tests/: fast/hal. The target tests_FOLDER builds all of a folder,
# slow_tests all slow ones: with sanitizers they are not among what is built by default, as CI runs the fast ones alone then.
function(geoflow_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;LABELS;PRIVATE_OF" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} geoflow_test_support GTest::gmock GTest::gtest_main
                                        geoflow_options)
  target_precompile_headers(${name} REUSE_FROM geoflow_test_support)
  foreach(part IN LISTS ARG_PRIVATE_OF)
    target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}/${part}")
  endforeach()
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/tests")
  if(NOT ARG_LABELS)
    set(ARG_LABELS fast)
  endif()
  file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}/tests" "${CMAKE_CURRENT_SOURCE_DIR}")
  string(REGEX REPLACE "/.*" "" folder "${folder}")
  if(NOT TARGET tests_${folder})
    add_custom_target(tests_${folder})
  endif()
  add_dependencies(tests_${folder} ${name})
  if("slow" IN_LIST ARG_LABELS)
    add_dependencies(slow_tests ${name})
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ${sanitized})
  endif()
  list(APPEND ARG_LABELS ${folder})
  list(REMOVE_DUPLICATES ARG_LABELS)
  # One label with slashes: gtest_discover_tests cannot pass on a list.
  list(JOIN ARG_LABELS "/" label)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES LABELS "${label}" TIMEOUT 600)
endfunction()

# geoflow_fuzz(NAME SOURCES … DEPENDS … [PRIVATE_OF part …])
# The fuzz target of one decoder, NAME_fuzz in fuzz/: its source defines LLVMFuzzerTestOneInput. With GEOFLOW_FUZZ (preset asan)
# it is linked with libFuzzer, and .ci/run runs it for a while; otherwise with seeds_main.cpp, as a test that runs the
# seeds in tests/fuzz/seeds/NAME and mutations of them. The target fuzz_targets builds them all.
function(geoflow_fuzz name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_OF" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} geoflow_options)
  target_compile_options(${name} PRIVATE ${geoflow_coverage})
  foreach(part IN LISTS ARG_PRIVATE_OF)
    target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}/${part}")
  endforeach()
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/fuzz")
  if(NOT TARGET fuzz_targets)
    add_custom_target(fuzz_targets)
  endif()
  add_dependencies(fuzz_targets ${name})
  if(GEOFLOW_FUZZ)
    target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  else()
    target_sources(${name} PRIVATE "${PROJECT_SOURCE_DIR}/tests/fuzz/seeds_main.cpp")
    string(REGEX REPLACE "_fuzz$" "" short ${name})
    add_test(NAME fuzz.${short} COMMAND ${name} "${PROJECT_SOURCE_DIR}/tests/fuzz/seeds/${short}")
    set_tests_properties(fuzz.${short} PROPERTIES LABELS fast/fuzz TIMEOUT 300)
  endif()
endfunction()
