/// \file
/// The label of a board that was found in a cloud without scan layers.

#ifndef ATOM_CORE_CPP_CLOUD_LABEL_H_
#define ATOM_CORE_CPP_CLOUD_LABEL_H_

#include <vector>

#include "cloud_patch.h"
#include "rectangle_sides.h"

namespace atom_core {

/// Labels the returns of a board, and those on its border.
///
/// \param patch the board's plane.
/// \param pose of its rectangle.
/// \param returns near the plane.
/// \param sides of the rectangle.
/// \param segment gets the label.
void LabelCloudBoard(const BoardSearch& search, const Patch& patch, const RectanglePose& pose,
                     const std::vector<PlaneReturn>& returns, const Sides& sides,
                     BoardSegment* segment);

}  // namespace atom_core

#endif  // ATOM_CORE_CPP_CLOUD_LABEL_H_
