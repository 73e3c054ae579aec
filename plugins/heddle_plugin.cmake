# SPDX-License-Identifier: Apache-2.0
# heddle_plugin(SOURCES pass.cpp [SHADERS a.comp.glsl ...] [LIBRARIES ...]) in plugins/<role>/<technique>/CMakeLists.txt
# builds that technique: the library, its manifest, its shaders beside it, and checks the shaders with neutral functions.
# In Heddle's own tree, and through find_package(heddle) outside of it.

# Copies role.toml files, shared GLSL and records.h to where libraries are built.
function(heddle_plugin_contracts source output)
  file(GLOB roles CONFIGURE_DEPENDS RELATIVE ${source} ${source}/*/role.toml)
  file(GLOB shared CONFIGURE_DEPENDS RELATIVE ${source} ${source}/shared/*.glsl ${source}/shared/*.h
       ${source}/shared/*.hpp)
  set(outputs)
  foreach(file ${roles} ${shared})
    add_custom_command(OUTPUT ${output}/${file} DEPENDS ${source}/${file}
                       COMMAND ${CMAKE_COMMAND} -E copy ${source}/${file} ${output}/${file})
    list(APPEND outputs ${output}/${file})
  endforeach()
  if(HEDDLE_PLUGINS_DIR)  # the installed roles and shared texts stand behind this folder's
    file(MAKE_DIRECTORY ${output})
    set(contracts ${output}:${HEDDLE_PLUGINS_DIR})
  else()
    add_custom_command(OUTPUT ${output}/shared/heddle/records.h DEPENDS ${CMAKE_SOURCE_DIR}/api/heddle/records.h
                       COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_SOURCE_DIR}/api/heddle/records.h
                               ${output}/shared/heddle/records.h)
    list(APPEND outputs ${output}/shared/heddle/records.h)
    set(contracts ${output})
  endif()
  add_custom_target(heddle_contracts ALL DEPENDS ${outputs})
  set_property(GLOBAL PROPERTY HEDDLE_PLUGIN_CONTRACTS ${contracts})
endfunction()

# Instead of heddle_plugin(), where the build machine lacks what the technique needs: whoever asks for the technique is
# told this reason.
function(heddle_plugin_left_out reason)
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR FILENAME technique)
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR PARENT_PATH role_folder)
  cmake_path(GET role_folder FILENAME role)
  # What an earlier build made is gone with the library.
  file(REMOVE_RECURSE ${HEDDLE_PLUGIN_OUTPUT}/${role}/${technique})
  file(WRITE ${HEDDLE_PLUGIN_OUTPUT}/${role}/${technique}/left_out.txt "${reason}\n")
endfunction()

# HEDDLE_PLUGIN_OUTPUT says where; tests set it to build plugins that do not ship.
function(heddle_plugin)
  cmake_parse_arguments(PARSE_ARGV 0 ARG "" "" "SOURCES;SHADERS;LIBRARIES")
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR FILENAME technique)
  cmake_path(GET CMAKE_CURRENT_SOURCE_DIR PARENT_PATH role_folder)
  cmake_path(GET role_folder FILENAME role)
  set(output ${HEDDLE_PLUGIN_OUTPUT}/${role}/${technique})
  file(REMOVE ${output}/left_out.txt)
  set(version_script ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/plugin.version)
  get_property(contracts GLOBAL PROPERTY HEDDLE_PLUGIN_CONTRACTS)
  set(target ${role}_${technique})
  add_library(${target} MODULE ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE heddle_api $<TARGET_NAME_IF_EXISTS:heddle_warnings> ${ARG_LIBRARIES}
                        -Wl,--version-script=${version_script} -Wl,-z,defs)
  target_compile_features(${target} PRIVATE cxx_std_20)
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR} ${role_folder}/../shared)
  if(HEDDLE_PLUGINS_DIR)
    target_include_directories(${target} PRIVATE ${HEDDLE_PLUGINS_DIR}/shared)
  endif()
  set_target_properties(${target} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${output} OUTPUT_NAME ${technique} PREFIX ""
                        C_VISIBILITY_PRESET hidden CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON
                        LINK_DEPENDS ${version_script})
  set(copies)
  foreach(shader ${ARG_SHADERS})
    add_custom_command(OUTPUT ${output}/${shader} DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${shader}
                       COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_CURRENT_SOURCE_DIR}/${shader} ${output}/${shader})
    list(APPEND copies ${output}/${shader})
  endforeach()
  add_custom_command(OUTPUT ${output}/${technique}.manifest.json DEPENDS ${target} heddle_manifest
                     COMMAND heddle_manifest $<TARGET_FILE:${target}> ${output}/${technique}.manifest.json)
  add_custom_command(OUTPUT ${output}/${technique}.checked
                     DEPENDS ${output}/${technique}.manifest.json ${copies} heddle_contracts heddle_check_shaders
                     COMMAND heddle_check_shaders ${contracts} ${output}/${technique}.manifest.json
                     COMMAND ${CMAKE_COMMAND} -E touch ${output}/${technique}.checked)
  add_custom_target(${target}_plugin ALL DEPENDS ${output}/${technique}.checked)
  set_property(GLOBAL APPEND PROPERTY HEDDLE_PLUGINS ${target}_plugin)
endfunction()
