# What sigmaik links, for its own build and for users of the installed package. Distributions differ in what the CMake
# files of KDL and TinyXML-2 define, so these two get targets of ours: sigmaik::kdl and sigmaik::tinyxml2.
include(CMakeFindDependencyMacro)

find_dependency(Eigen3 NO_MODULE)

find_dependency(orocos_kdl)  # upstream: a target without include directories; Debian: only variables
if(NOT TARGET sigmaik::kdl)
  find_path(SIGMAIK_KDL_INCLUDE_DIR kdl/chain.hpp HINTS ${orocos_kdl_INCLUDE_DIRS})
  find_library(SIGMAIK_KDL_LIBRARY orocos-kdl HINTS ${SIGMAIK_KDL_INCLUDE_DIR}/../lib)
  mark_as_advanced(SIGMAIK_KDL_INCLUDE_DIR SIGMAIK_KDL_LIBRARY)
  if(NOT SIGMAIK_KDL_INCLUDE_DIR OR NOT SIGMAIK_KDL_LIBRARY)
    message(FATAL_ERROR "sigmaik: KDL not found (Debian: liborocos-kdl-dev)")
  endif()
  add_library(sigmaik::kdl INTERFACE IMPORTED)
  target_include_directories(sigmaik::kdl INTERFACE ${SIGMAIK_KDL_INCLUDE_DIR})
  target_link_libraries(sigmaik::kdl INTERFACE ${SIGMAIK_KDL_LIBRARY} Eigen3::Eigen)
endif()

# Private to sigmaik: only who links it statically, or builds it, needs to find them.
if(NOT DEFINED sigmaik_IS_STATIC OR sigmaik_IS_STATIC)
  find_dependency(Threads)
  find_dependency(console_bridge)
  find_dependency(urdfdom)

  find_package(tinyxml2 CONFIG QUIET)
  if(NOT TARGET sigmaik::tinyxml2)
    add_library(sigmaik::tinyxml2 INTERFACE IMPORTED)
    if(TARGET tinyxml2::tinyxml2)
      target_link_libraries(sigmaik::tinyxml2 INTERFACE tinyxml2::tinyxml2)
    else()
      find_path(SIGMAIK_TINYXML2_INCLUDE_DIR tinyxml2.h)
      find_library(SIGMAIK_TINYXML2_LIBRARY tinyxml2)
      mark_as_advanced(SIGMAIK_TINYXML2_INCLUDE_DIR SIGMAIK_TINYXML2_LIBRARY)
      if(NOT SIGMAIK_TINYXML2_INCLUDE_DIR OR NOT SIGMAIK_TINYXML2_LIBRARY)
        message(FATAL_ERROR "sigmaik: TinyXML-2 not found (Debian: libtinyxml2-dev)")
      endif()
      target_include_directories(sigmaik::tinyxml2 INTERFACE ${SIGMAIK_TINYXML2_INCLUDE_DIR})
      target_link_libraries(sigmaik::tinyxml2 INTERFACE ${SIGMAIK_TINYXML2_LIBRARY})
    endif()
  endif()
endif()
