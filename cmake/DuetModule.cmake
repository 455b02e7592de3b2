# duet_add_module(<room> SOURCES ... LINK ... [COLD]): the library duet_<room>, duet::<room> to others. One room = one
# folder = one target. COLD: words, tables and files; what takes time is in other rooms, and -O1 compiles a third sooner.
# duet_add_test(<room> SOURCES ... LINK ... [HEADERS ...] [SHARDS n] [SERIAL]): the GoogleTest program <room>_test, which
#   ctest runs as <room>, or in SHARDS parts side by side (<room>/0, ...), each TEST once; HEADERS are compiled once for
#   all of its sources, beside those that every test has.
# duet_add_tool(<name> SOURCES ... LINK ...): a program beside the tests that a person or a test runs.
# duet_add_fuzzer(<name> SOURCES ... LINK ...): a libFuzzer program (preset `dev`).
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt REQUIRED)
find_package(Threads REQUIRED)

# Of this folder and those below it; a project that takes duet in by add_subdirectory keeps its own.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)

find_program(DUET_CCACHE ccache)
if(DUET_CCACHE)
  # The sloppiness is what it needs to know the tests' precompiled headers.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${DUET_CCACHE})
endif()

# What everybody who includes duet's headers needs.
add_library(duet_options INTERFACE)
# "duet/<room>/<header>.h" means the same inside the tree as it does outside, where the headers are installed under such
# a folder.
file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/include)
file(CREATE_LINK ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/include/duet SYMBOLIC)
target_include_directories(duet_options INTERFACE $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>
                                                  $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_compile_features(duet_options INTERFACE cxx_std_20)
target_link_libraries(duet_options INTERFACE Eigen3::Eigen fmt::fmt Threads::Threads)
# Eigen aligns by the widest instruction set that it may use: a program that may use wider ones than duet (-march=native)
# has to lay out the types of duet's headers as duet does.
target_compile_definitions(duet_options INTERFACE $<INSTALL_INTERFACE:EIGEN_MAX_ALIGN_BYTES=16>)
if(NOT PROJECT_IS_TOP_LEVEL)
  target_compile_definitions(duet_options INTERFACE $<BUILD_INTERFACE:EIGEN_MAX_ALIGN_BYTES=16>)
endif()
set_target_properties(duet_options PROPERTIES EXPORT_NAME options)
add_library(duet::options ALIAS duet_options)

# How duet itself is compiled; nobody who links it inherits this. Contraction is off so that the same source gives the
# same bits whatever the optimiser chooses; wider instruction sets appear only in kernel files that dispatch at run time.
add_library(duet_flags INTERFACE)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$")
  set(DUET_X86 TRUE)  # kernels for wider sets are compiled beside the portable ones
endif()
target_compile_options(duet_flags INTERFACE -Wall -Wextra $<$<BOOL:${DUET_X86}>:-march=x86-64-v2> -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC 12 takes the sum of two std::string for a write past the end, if the constant one is longer than 15 characters.
  target_compile_options(duet_flags INTERFACE -Wno-array-bounds)
endif()
if(DUET_WERROR)
  target_compile_options(duet_flags INTERFACE -Werror)
endif()
if(DUET_SANITIZE)
  # What the undefined-behaviour sanitizer finds ends the program: a message alone would pass a test. Four of its checks
  # are left out, which take as long to compile as all the others: a null pointer and a wrong alignment end the program
  # anyhow, and sizes of objects are what the address sanitizer looks at.
  set(sanitizers -fsanitize=address,undefined -fno-sanitize=null,alignment,vptr,object-size -fno-sanitize-recover=all)
  target_compile_options(duet_flags INTERFACE ${sanitizers} -fno-omit-frame-pointer -O1)
  target_link_options(duet_flags INTERFACE ${sanitizers})
  target_compile_definitions(duet_flags INTERFACE DUET_SANITIZED)
endif()
if(DUET_FUZZ)
  target_compile_options(duet_flags INTERFACE -fsanitize=fuzzer-no-link)
endif()

# Compiles the sources of a folder together, at most twenty at a time: half of a room's compilation is headers that its
# files share. File-local names are therefore unique in a folder.
function(duet_unite target)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    cmake_path(GET source PARENT_PATH folder)
    string(MAKE_C_IDENTIFIER "in_${folder}" group)
    math(EXPR count_${group} "0${count_${group}} + 1")
    math(EXPR part "${count_${group}} / 21")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group}_${part})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${DUET_UNITY} UNITY_BUILD_MODE GROUP)
endfunction()

function(duet_add_module room)
  cmake_parse_arguments(ARG "COLD" "" "SOURCES;LINK" ${ARGN})
  add_library(duet_${room} STATIC ${ARG_SOURCES})
  duet_unite(duet_${room})
  target_link_libraries(duet_${room} PUBLIC duet_options ${ARG_LINK} PRIVATE $<BUILD_INTERFACE:duet_flags>)
  if(ARG_COLD)
    target_compile_options(duet_${room} PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
  set_target_properties(duet_${room} PROPERTIES EXPORT_NAME ${room})
  add_library(duet::${room} ALIAS duet_${room})
endfunction()

# What is timed is in the rooms.
set(DUET_TEST_OPTIMISATION $<IF:$<BOOL:${DUET_SANITIZE}>,-O0,$<$<CONFIG:Release>:-O1>>)

function(duet_add_test room)
  cmake_parse_arguments(ARG "SERIAL" "SHARDS" "SOURCES;LINK;HEADERS" ${ARGN})
  find_package(GTest REQUIRED)
  add_executable(${room}_test ${ARG_SOURCES})
  target_link_libraries(${room}_test PRIVATE duet_flags duet_options ${ARG_LINK} GTest::gtest GTest::gmock GTest::gtest_main)
  target_include_directories(${room}_test PRIVATE ${PROJECT_SOURCE_DIR})  # "tests/<room>/..."
  target_compile_definitions(${room}_test PRIVATE DUET_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_compile_options(${room}_test PRIVATE ${DUET_TEST_OPTIMISATION})
  # Half of a test's compilation. The rooms themselves have none: clang-tidy cannot read those of GCC.
  target_precompile_headers(${room}_test PRIVATE <gmock/gmock.h> <gtest/gtest.h> <Eigen/Geometry> <fmt/format.h> ${ARG_HEADERS})
  # A process a program, not a TEST: starting 3,700 of them took longer than what they test. The longest begin first.
  if(NOT ARG_SHARDS)
    set(ARG_SHARDS 1)
  endif()
  math(EXPR last "${ARG_SHARDS} - 1")
  foreach(shard RANGE ${last})
    set(name ${room})
    if(ARG_SHARDS GREATER 1)
      set(name ${room}/${shard})
    endif()
    add_test(NAME ${name} COMMAND ${room}_test --gtest_print_time=1 WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
    set_tests_properties(${name} PROPERTIES TIMEOUT 1800 RUN_SERIAL "${ARG_SERIAL}" COST ${ARG_SHARDS}
                         ENVIRONMENT "GTEST_TOTAL_SHARDS=${ARG_SHARDS};GTEST_SHARD_INDEX=${shard}")
  endforeach()
endfunction()

function(duet_add_tool name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  find_package(GTest REQUIRED)
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE duet_flags duet_options ${ARG_LINK} GTest::gtest)  # fixtures are those of tests
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${name} PRIVATE DUET_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_compile_options(${name} PRIVATE ${DUET_TEST_OPTIMISATION})
endfunction()

function(duet_add_fuzzer name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(fuzz_${name} ${ARG_SOURCES})
  target_link_libraries(fuzz_${name} PRIVATE duet_flags duet_options ${ARG_LINK})
  target_include_directories(fuzz_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(fuzz_${name} PRIVATE DUET_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
endfunction()
