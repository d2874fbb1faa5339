/// \file
/// The parts of the module `atom_core._core`, one source file each.

#ifndef ATOM_CORE_BINDINGS_BINDINGS_H_
#define ATOM_CORE_BINDINGS_BINDINGS_H_

#include <pybind11/pybind11.h>

namespace atom_core {

void BindBoardSegmentation(pybind11::module& m);
void BindCalibration(pybind11::module& m);

}  // namespace atom_core

#endif  // ATOM_CORE_BINDINGS_BINDINGS_H_
