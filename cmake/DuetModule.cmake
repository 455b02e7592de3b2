# duet_add_module(<room> SOURCES ... LINK ... [COLD]): the library duet_<room>, duet::<room> to others. One room = one
# folder = one target. COLD: words, tables and files; what takes time is in other rooms, and -O1 compiles a third sooner.
# duet_add_test(<room> SOURCES ... LINK ... [HEADERS ...] [SHARDS n] [SERIAL]): the GoogleTest program <room>_test, which
#   ctest runs as <room>, or in SHARDS parts side by side (<room>/0, ...), each TEST once; HEADERS are compiled once for
#   all of its sources, beside those that every test has.
# duet_add_tool(<name> SOURCES ... LINK ...): a program beside the tests that a person or a test runs.
# duet_add_part(<name> SOURCES ... LINK ...): what parts/<name> adds to the program (app/part.h), the library duet_part_<name>.
# duet_add_program(): the program `duet` with the parts of DUET_PARTS.
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

# The folder of the sources: this one is included by the parts' own project (parts/CMakeLists.txt), too.
cmake_path(GET CMAKE_CURRENT_LIST_DIR PARENT_PATH DUET_SOURCES)

if(TARGET duet::options)
  # Beside an installed core: of this tree's headers only those of rooms that are built here are seen.
  set(DUET_BESIDE_CORE TRUE)
  include_directories(${PROJECT_BINARY_DIR}/include)
else()
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
endif()

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

function(duet_show_headers folder)  # where only some rooms' headers are seen, those of this folder
  if(DUET_BESIDE_CORE)
    cmake_path(GET folder PARENT_PATH above)
    file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/include/duet/${above})
    file(CREATE_LINK ${DUET_SOURCES}/${folder} ${PROJECT_BINARY_DIR}/include/duet/${folder} SYMBOLIC)
  endif()
endfunction()

function(duet_add_module room)
  cmake_parse_arguments(ARG "COLD" "" "SOURCES;LINK" ${ARGN})
  duet_show_headers(${room})
  add_library(duet_${room} STATIC ${ARG_SOURCES})
  duet_unite(duet_${room})
  target_link_libraries(duet_${room} PUBLIC duet::options ${ARG_LINK} PRIVATE $<BUILD_INTERFACE:duet_flags>)
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
  if(NOT TARGET duet_test_main)  # main(), and the golden files of sentences
    add_library(duet_test_main STATIC ${DUET_SOURCES}/tests/sentences.cpp)
    target_include_directories(duet_test_main PRIVATE ${DUET_SOURCES})
    target_compile_definitions(duet_test_main PRIVATE DUET_SOURCE_DIR="${DUET_SOURCES}")
    target_link_libraries(duet_test_main PRIVATE duet_flags duet::options PUBLIC GTest::gtest GTest::gmock)
  endif()
  add_executable(${room}_test ${ARG_SOURCES})
  target_link_libraries(${room}_test PRIVATE duet_flags duet::options ${ARG_LINK} duet_test_main)
  target_include_directories(${room}_test PRIVATE ${DUET_SOURCES})  # "tests/<room>/..."
  target_compile_definitions(${room}_test PRIVATE DUET_SOURCE_DIR="${DUET_SOURCES}")
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
    add_test(NAME ${name} COMMAND ${room}_test --gtest_print_time=1 WORKING_DIRECTORY ${DUET_SOURCES})
    set_tests_properties(${name} PROPERTIES TIMEOUT 1800 RUN_SERIAL "${ARG_SERIAL}" COST ${ARG_SHARDS}
                         ENVIRONMENT "GTEST_TOTAL_SHARDS=${ARG_SHARDS};GTEST_SHARD_INDEX=${shard}")
  endforeach()
endfunction()

function(duet_add_tool name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  find_package(GTest REQUIRED)
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE duet_flags duet::options ${ARG_LINK} GTest::gtest)  # fixtures are those of tests
  target_include_directories(${name} PRIVATE ${DUET_SOURCES})
  target_compile_definitions(${name} PRIVATE DUET_SOURCE_DIR="${DUET_SOURCES}")
  target_compile_options(${name} PRIVATE ${DUET_TEST_OPTIMISATION})
endfunction()

function(duet_add_fuzzer name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(fuzz_${name} ${ARG_SOURCES})
  target_link_libraries(fuzz_${name} PRIVATE duet_flags duet::options ${ARG_LINK})
  target_include_directories(fuzz_${name} PRIVATE ${DUET_SOURCES})
  target_compile_definitions(fuzz_${name} PRIVATE DUET_SOURCE_DIR="${DUET_SOURCES}")
  target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
endfunction()

function(duet_add_part name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  find_package(CLI11 REQUIRED)
  duet_show_headers(parts/${name})
  add_library(duet_part_${name} STATIC ${ARG_SOURCES})
  duet_unite(duet_part_${name})
  # Words and arguments: what takes time is in the rooms.
  target_compile_options(duet_part_${name} PRIVATE $<$<CONFIG:Release>:-O1>)
  target_link_libraries(duet_part_${name} PUBLIC duet::app ${ARG_LINK} CLI11::CLI11 PRIVATE duet_flags)
endfunction()

function(duet_add_program)
  set(DUET_PART_HEADERS "")
  set(DUET_PART_CALLS "")
  set(libraries duet::app)
  foreach(part IN LISTS DUET_PARTS)
    string(APPEND DUET_PART_HEADERS "#include \"duet/parts/${part}/part.h\"\n")
    list(APPEND DUET_PART_CALLS "duet::${part}_part()")
    list(APPEND libraries duet_part_${part})
  endforeach()
  list(JOIN DUET_PART_CALLS ", " DUET_PART_CALLS)
  find_package(CLI11 REQUIRED)
  configure_file(${DUET_SOURCES}/cmake/duet_main.cpp.in ${PROJECT_BINARY_DIR}/duet_main.cpp @ONLY)
  add_executable(duet ${PROJECT_BINARY_DIR}/duet_main.cpp)
  target_compile_options(duet PRIVATE $<$<CONFIG:Release>:-O1>)
  target_link_libraries(duet PRIVATE duet_flags ${libraries} CLI11::CLI11)
  set_target_properties(duet PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR})
endfunction()

# Rooms in include order, and of which part each is (cmake/rooms.txt): DUET_ROOMS_OF_core, DUET_ROOMS_OF_robot, ...; the
# names of the parts: DUET_ALL_PARTS.
file(STRINGS ${DUET_SOURCES}/cmake/rooms.txt lines REGEX "^[a-z]+:|^\\[[a-z]+")
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${DUET_SOURCES}/cmake/rooms.txt)
set(DUET_ALL_PARTS "")
foreach(line IN LISTS lines)
  if(line MATCHES "^\\[([a-z]+)( needs ([a-z ]+))?\\]$")
    set(part ${CMAKE_MATCH_1})
    string(REPLACE " " ";" DUET_NEEDS_OF_${part} "${CMAKE_MATCH_3}")
    list(APPEND DUET_ALL_PARTS ${part})
    set(DUET_ROOMS_OF_${part} "")
  else()
    string(REGEX REPLACE ":.*" "" room "${line}")
    list(APPEND DUET_ROOMS_OF_${part} ${room})
  endif()
endforeach()
list(REMOVE_ITEM DUET_ALL_PARTS core)
set(DUET_PARTS "" CACHE STRING "Parts that are built beside the core (parts/): ${DUET_ALL_PARTS}, or `all`")
set(asked ${DUET_PARTS})
if("all" IN_LIST asked)
  set(asked ${DUET_ALL_PARTS})
endif()
foreach(part IN LISTS asked)
  if(NOT part IN_LIST DUET_ALL_PARTS)
    list(JOIN DUET_ALL_PARTS ", " known)
    message(FATAL_ERROR "DUET_PARTS: expected some of ${known}, or `all`, found '${part}'")
  endif()
  list(APPEND asked ${DUET_NEEDS_OF_${part}})
endforeach()
# In the order of the rooms, each with what it needs; hides the entry of the cache.
set(DUET_PARTS ${DUET_ALL_PARTS})
foreach(part IN LISTS DUET_ALL_PARTS)
  if(NOT part IN_LIST asked)
    list(REMOVE_ITEM DUET_PARTS ${part})
  endif()
endforeach()
