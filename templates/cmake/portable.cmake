# The builds of a portable library: every kernel once for each line of templates/portable/x86-64.txt, its functions renamed, and
# portable.c, in which the plain names pass their arguments on to the build for this processor. The Python package does the
# same (symrender_cg/build/portable.py).
#
# Reads kernel_sources, kernel_headers and kernel_flags.

set(symrender_portable_folder "${CMAKE_CURRENT_LIST_DIR}/../portable")

# <result>: the sources of the portable library, among them the objects of its builds; empty where the processor's kind has no
# such builds.
function(symrender_portable_sources result)
  set(${result} "" PARENT_SCOPE)
  set(builds_file "${symrender_portable_folder}/x86-64.txt")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${builds_file}" ${kernel_headers})
  check_c_source_compiles("
    #ifndef __x86_64__
    #error another kind
    #endif
    int main(void) { return 0; }" SYMRENDER_IS_X86_64)
  if(NOT SYMRENDER_IS_X86_64)
    return()
  endif()

  symrender_entry_points(names functions)
  set(sources "${PROJECT_BINARY_DIR}/portable.c")
  file(STRINGS "${builds_file}" builds REGEX "^x")
  foreach(build IN LISTS builds)
    separate_arguments(flags UNIX_COMMAND "${build}")
    list(POP_FRONT flags name)
    string(REPLACE "-" "_" suffix "_${name}")
    set(target "symrender_cg${suffix}")
    add_library(${target} OBJECT ${kernel_sources})
    set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON C_VISIBILITY_PRESET hidden)
    target_compile_options(${target} PRIVATE ${kernel_flags} ${flags})
    target_include_directories(${target} PRIVATE "${SYMRENDER_KERNELS}/support")
    foreach(function IN LISTS names)
      target_compile_definitions(${target} PRIVATE "${function}=${function}${suffix}")
    endforeach()
    list(APPEND sources "$<TARGET_OBJECTS:${target}>")
  endforeach()

  set(includes)
  foreach(header IN LISTS kernel_headers)
    get_filename_component(file "${header}" NAME)
    string(APPEND includes "#include <symrender_cg/${file}>\n")
  endforeach()
  configure_file("${symrender_portable_folder}/portable.c.in" "${PROJECT_BINARY_DIR}/portable.c" @ONLY)
  set(${result} "${sources}" PARENT_SCOPE)
endfunction()

# <names>: the functions that the kernels' headers declare. <functions>: C that passes each of them on.
function(symrender_entry_points names functions)
  set(found)
  set(text)
  foreach(header IN LISTS kernel_headers)
    file(READ "${header}" declared)
    string(REGEX REPLACE "/\\*[^*]*\\*+([^/*][^*]*\\*+)*/" "" declared "${declared}")
    string(REPLACE ";" "@" declared "${declared}")   # a semicolon would part the list
    string(REGEX MATCHALL "\n[a-z][^@{}()]*\\([^@{}()]*\\)@" prototypes "${declared}")
    foreach(prototype IN LISTS prototypes)
      string(REGEX REPLACE "[ \n]+" " " prototype "${prototype}")
      if(NOT prototype MATCHES "^ (.*[ *])([a-z_0-9]+)\\((.*)\\)@$")
        message(FATAL_ERROR "symrender_cg: ${header}: this is no prototype that can be passed on: ${prototype}")
      endif()
      set(returns "${CMAKE_MATCH_1}")
      set(name "${CMAKE_MATCH_2}")
      set(parameters "${CMAKE_MATCH_3}")
      string(REGEX REPLACE "[^,]*[ *]([a-z_0-9]+)(,|$)" "\\1\\2 " arguments "${parameters}")
      string(STRIP "${arguments}" arguments)
      string(STRIP "${returns}" returns)
      set(return "return ")
      if(returns STREQUAL "void")
        set(return "")
      endif()
      list(APPEND found "${name}")
      string(APPEND text "DECLARE(${name})@\n${returns} ${name}(${parameters})\n"
                         "{\n    ${return}PICK(${name}, (${arguments}))@\n}\n\n")
    endforeach()
  endforeach()
  string(REPLACE "@" ";" text "${text}")
  set(${names} "${found}" PARENT_SCOPE)
  set(${functions} "${text}" PARENT_SCOPE)
endfunction()
