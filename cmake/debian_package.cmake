# The install space as one Debian package below /opt/atom, by CPack: `make deb`.
#
# What the compiled parts link is found by dpkg-shlibdeps; what programs import and start stands in
# requirements/deb.txt. With another CMAKE_INSTALL_PREFIX the package goes there.
file(STRINGS ${CMAKE_CURRENT_SOURCE_DIR}/requirements/deb.txt depends REGEX "^[^#]")
string(REGEX REPLACE "[ ;]+" ", " CPACK_DEBIAN_PACKAGE_DEPENDS "${depends}")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME atom-calibration)
set(CPACK_PACKAGE_VERSION ${atom_VERSION})
set(CPACK_PACKAGE_CONTACT "ATOM suite maintainers <maintainers@example.org>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Calibration of many sensors of many kinds, for ROS 1")
set(CPACK_PACKAGE_DESCRIPTION
  "Sensors and boards are calibrated in one optimisation, from sensor to pattern.
After `source ${CMAKE_INSTALL_PREFIX}/setup.bash` the programs are `rosrun atom_calibration ...`.
Descriptions in xacro need xacro, the simulator mujoco and PyOpenGL, all of them from PyPI.")
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PACKAGING_INSTALL_PREFIX ${CMAKE_INSTALL_PREFIX})
set(CPACK_STRIP_FILES ON)
# Compiled Python names the folder of the build: it is made where the package is installed. Messages
# are compiled in spite of PYTHONDONTWRITEBYTECODE; `make deb` sets both.
set(python_folder ${CMAKE_INSTALL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION})
install(CODE "
  if(\"\$ENV{ATOM_WITHOUT_COMPILED_PYTHON}\")
    file(GLOB_RECURSE compiled LIST_DIRECTORIES true \"\$ENV{DESTDIR}${python_folder}/*\")
    list(FILTER compiled INCLUDE REGEX \"/__pycache__$\")
    if(compiled)
      file(REMOVE_RECURSE \${compiled})
    endif()
  endif()")
foreach(script postinst prerm)
  configure_file(cmake/${script}.in ${CMAKE_CURRENT_BINARY_DIR}/debian/${script} @ONLY)
  list(APPEND CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_BINARY_DIR}/debian/${script})
endforeach()
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
include(CPack)
