#include "cloud_filling.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace atom_core {
namespace {

constexpr double kCellSpacings = 2.0;
constexpr double kLeastCell = 0.01;  // [m]
constexpr int kMargin = 2;           // cells around the rectangle
constexpr double kConeMargin = 1.2;  // of the circle about the cells

// Points that are met in a cell: on the plane, nearer to the sensor, and farther from it.
struct Content {
  int there = 0, nearer = 0, farther = 0;
};

// Cells of a rectangle and around it.
class Cells {
 public:
  Cells(const Eigen::Vector2d& half, double cell) : half_(half) {
    for (int axis = 0; axis < 2; ++axis) {
      inner_[axis] = std::max(3, static_cast<int>(std::lround(2.0 * half[axis] / cell)));
      cell_[axis] = 2.0 * half[axis] / inner_[axis];
      count_[axis] = inner_[axis] + 2 * kMargin;
    }
    content_.resize(static_cast<std::size_t>(count_[0]) * count_[1]);
  }

  // The content at a point in the rectangle's axes; none outside the cells.
  Content* At(const Eigen::Vector2d& point) {
    const Eigen::Vector2d place = (point + half_).cwiseQuotient(cell_);
    const int x = static_cast<int>(std::floor(place.x())) + kMargin;
    const int y = static_cast<int>(std::floor(place.y())) + kMargin;
    if (x < 0 || y < 0 || x >= count_[0] || y >= count_[1]) return nullptr;
    return &Cell(x, y);
  }
  // Those of the rectangle, counted from its corner.
  const Content& Inner(int x, int y) { return Cell(x + kMargin, y + kMargin); }
  // The middle of one of them, in the rectangle's axes.
  Eigen::Vector2d Middle(int x, int y) const {
    return Eigen::Vector2d(x + 0.5, y + 0.5).cwiseProduct(cell_) - half_;
  }
  const Eigen::Vector2i& inner() const { return inner_; }
  const Eigen::Vector2d& cell() const { return cell_; }
  double Radius() const { return (half_ + kMargin * cell_).norm(); }

 private:
  Content& Cell(int x, int y) { return content_[static_cast<std::size_t>(y) * count_[0] + x]; }

  Eigen::Vector2d half_, cell_;
  Eigen::Vector2i inner_, count_;
  std::vector<Content> content_;
};

void Fill(const Scan& scan, const PlaneAxes& axes, const RectanglePose& pose, Cells* cells) {
  const Eigen::Vector3d middle = axes.InSpace(pose.centre);
  const double radius = kConeMargin * cells->Radius(), away = middle.norm();
  const double sine = std::min(radius / std::max(away, 1e-9), 1.0);
  const double cosine = std::sqrt(std::max(0.0, 1.0 - sine * sine));
  const Plane& plane = axes.plane;
  for (const ScanPoint& point : scan.points) {
    if (point.position.dot(middle) < cosine * away * point.range) continue;
    const double slant = plane.normal.dot(point.position) / point.range;
    if (slant < 1e-3) continue;
    const bool holds = plane.Holds(point);
    const Eigen::Vector3d met = point.position * (plane.distance / slant / point.range);
    Content* content = cells->At(pose.ToBoard(axes.InPlane(holds ? point.position : met)));
    if (content == nullptr) continue;
    const int side = plane.Side(point);
    content->there += holds;
    content->nearer += !holds && side < 0;
    content->farther += !holds && side > 0;
  }
}

// Whether a cell has points on both sides, along the rows and along the columns.
bool IsEnclosed(Cells* cells, int x, int y) {
  bool found[4] = {false, false, false, false};
  const Eigen::Vector2i count = cells->inner();
  for (int i = 0; i < count.x(); ++i) {
    if (i != x && cells->Inner(i, y).there > 0) found[i < x ? 0 : 1] = true;
  }
  for (int i = 0; i < count.y(); ++i) {
    if (i != y && cells->Inner(x, i).there > 0) found[i < y ? 2 : 3] = true;
  }
  return found[0] && found[1] && found[2] && found[3];
}

CellShares Count(const View& view, const RectanglePose& pose, Cells* cells) {
  CellShares shares;
  const Eigen::Vector2i count = cells->inner();
  const Eigen::Rotation2Dd turn(pose.angle);
  int in_view = 0;
  const auto is_in_view = [&](int x, int y) {
    return view.Sees(pose.centre + turn * cells->Middle(x, y));
  };
  for (int y = 0; y < count.y(); ++y) {
    for (int x = 0; x < count.x(); ++x) in_view += is_in_view(x, y);
  }
  shares.in_view = static_cast<double>(in_view) / count.prod();
  const double one = 1.0 / std::max(in_view, 1);
  for (int y = 0; y < count.y(); ++y) {
    for (int x = 0; x < count.x(); ++x) {
      if (!is_in_view(x, y)) continue;
      const Content& content = cells->Inner(x, y);
      if (content.there > 0) {
        shares.there += one;
      } else if (content.nearer > 0) {
        shares.nearer += one;
      } else if (content.farther > 0) {
        shares.farther += one;
      } else if (IsEnclosed(cells, x, y)) {
        shares.enclosed += one;
      }
    }
  }
  return shares;
}

// A side is hidden where something nearer begins just outside it, or where it should be. Single
// returns from before what most beams there meet (rain, dust) hide nothing.
void MarkHidden(const Eigen::Vector2d& half, Cells* cells, Sides* sides) {
  for (int k = 0; k < 4; ++k) {
    const int axis = k / 2;
    for (SideBin& bin : (*sides)[k]) {
      for (const double step : {-0.5, 0.5}) {
        Eigen::Vector2d place;
        place[axis] = (half[axis] + step * cells->cell()[axis]) * (k % 2 == 0 ? 1.0 : -1.0);
        place[1 - axis] = bin.along;
        const Content* content = cells->At(place);
        if (content == nullptr || content->nearer <= content->farther) continue;
        if (step > 0 || content->there == 0) bin.hidden = true;
      }
    }
  }
}

}  // namespace

CellShares LookAtCells(const Scan& scan, const View& view, const RectanglePose& pose,
                       const Eigen::Vector2d& half, double spacing, Sides* sides) {
  Cells cells(half, std::max(kCellSpacings * spacing, kLeastCell));
  Fill(scan, view.axes, pose, &cells);
  MarkHidden(half, &cells, sides);
  return Count(view, pose, &cells);
}

}  // namespace atom_core
