#include "view_edge.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace atom_core {
namespace {

constexpr int kViewSectors = 60;          // about the middle of the piece
constexpr std::size_t kLeastSectors = 5;  // of an edge
constexpr std::size_t kMostTried = 24;    // of the sectors of a run, of which circles are laid
constexpr double kTightest = 0.985;       // cosine of the radius of a circle: ten degrees
constexpr double kViewReach = 1.4;        // of the diagonal: as far as is looked
constexpr double kViewOpen = 0.9;         // of the reach: what ends before it is open
constexpr double kPieceReach = 0.8;       // of the diagonal: so far the piece may reach
constexpr double kRough = 2.5;            // spacings about a first edge, and
constexpr double kFine = 2.0;             // about the edge
constexpr double kEdgeBinSpacings = 2.0;
constexpr int kFits = 3;
constexpr int kLeastEdgeBins = 3;      // that the piece ends in, and that end on either side of it
constexpr int kMostGaps = 1;           // among those on either side
constexpr double kStraightEdge = 0.8;  // of the bins between end at the edge
constexpr double kEdgeMargin = 1.5;    // spacings
constexpr std::size_t kMostEdges = 2;  // that cut one piece

// A direction in which something returns.
struct Ray {
  Eigen::Vector3d direction;
  bool on_piece;
};

// Where the returns of a sector end.
struct End {
  double away = -1.0;  // tangent of the angle from the middle
  int ray = -1;
};

std::vector<Ray> RaysAround(const Scan& scan, const PlaneAxes& axes, double diagonal) {
  const double away = axes.origin.norm(), reach = kViewReach * diagonal / away;
  const Eigen::Vector3d middle = axes.origin / away;
  const double cosine = 1.0 / std::sqrt(1.0 + reach * reach);
  std::vector<Ray> rays;
  for (const ScanPoint& point : scan.points) {
    const Eigen::Vector3d direction = point.position / point.range;
    if (direction.dot(middle) < cosine) continue;
    const bool near = (point.position - axes.origin).norm() < kPieceReach * diagonal;
    rays.push_back({direction, near && axes.plane.Holds(point)});
  }
  return rays;
}

std::vector<End> EndsOfSectors(const std::vector<Ray>& rays, const Eigen::Vector3d& middle) {
  const Eigen::Vector3d right = middle.unitOrthogonal(), up = middle.cross(right);
  std::vector<End> ends(kViewSectors);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double ahead = rays[i].direction.dot(middle);
    const Eigen::Vector2d place(rays[i].direction.dot(right), rays[i].direction.dot(up));
    const double turn = std::atan2(place.y(), place.x()) / (2.0 * M_PI) + 0.5;
    End& end = ends[std::min(static_cast<int>(turn * kViewSectors), kViewSectors - 1)];
    if (place.norm() / ahead > end.away) end = {place.norm() / ahead, static_cast<int>(i)};
  }
  return ends;
}

// The ends of neighbouring sectors beyond which nothing returns, run by run.
std::vector<std::vector<int>> OpenRuns(const std::vector<End>& ends, double reach) {
  const auto is_open = [&](int k) { return ends[k % kViewSectors].away < kViewOpen * reach; };
  std::vector<std::vector<int>> runs;
  int first = 0;
  while (first < kViewSectors && is_open(first)) ++first;
  std::vector<int> run;
  for (int k = first; k <= first + kViewSectors; ++k) {
    const int ray = ends[k % kViewSectors].ray;
    const bool is_last = k == first + kViewSectors;
    if (is_open(k) && !is_last) {
      if (ray >= 0) run.push_back(ray);
      continue;
    }
    if (run.size() >= kLeastSectors) runs.push_back(run);
    run.clear();
  }
  return runs;
}

// The circle through three directions, with the middle inside.
bool CircleThrough(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                   const Eigen::Vector3d& middle, ViewEdge* edge) {
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  if (normal.norm() < 1e-9) return false;
  edge->normal = normal.normalized();
  edge->level = edge->normal.dot(a);
  if (std::abs(edge->level) > kTightest) return false;
  if (edge->normal.dot(middle) > edge->level) {
    edge->normal = -edge->normal, edge->level = -edge->level;
  }
  return true;
}

double Beyond(const ViewEdge& edge, const Eigen::Vector3d& direction) {
  return edge.normal.dot(direction) - edge.level;
}

// The circle at which most of a run's ends lie, and how well; about their number.
double FirstEdge(const std::vector<Ray>& rays, const std::vector<int>& run,
                 const Eigen::Vector3d& middle, double tolerance, ViewEdge* best) {
  std::vector<Eigen::Vector3d> ends;
  const std::size_t step = (run.size() + kMostTried - 1) / kMostTried;
  for (std::size_t i = 0; i < run.size(); i += step) ends.push_back(rays[run[i]].direction);
  double most = 0.0;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    for (std::size_t k = i + 1; k < ends.size(); ++k) {
      for (std::size_t j = k + 1; j < ends.size(); ++j) {
        ViewEdge edge;
        if (!CircleThrough(ends[i], ends[k], ends[j], middle, &edge)) continue;
        double worth = 0.0;
        for (const int ray : run) {
          const double off = Beyond(edge, rays[ray].direction) / tolerance;
          worth += std::max(0.0, 1.0 - off * off);
        }
        if (worth > most) most = worth, *best = edge;
      }
    }
  }
  return most;
}

// Places along an edge, and the outermost returns there.
struct Bins {
  Eigen::Vector3d along;
  double from = 0.0, width = 1.0;
  std::vector<int> outermost;  // rays; -1: none
};

Bins BinsAlong(const std::vector<Ray>& rays, const ViewEdge& edge, const Eigen::Vector3d& middle,
               double spacing) {
  Bins bins;
  bins.along = edge.normal.cross(middle).normalized();
  double to = -1.0;
  bins.from = 1.0;
  for (const Ray& ray : rays) {
    const double place = bins.along.dot(ray.direction);
    bins.from = std::min(bins.from, place), to = std::max(to, place);
  }
  const int count = std::max(static_cast<int>((to - bins.from) / (kEdgeBinSpacings * spacing)), 1);
  bins.width = (to - bins.from) / count;
  bins.outermost.assign(count, -1);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double place = (bins.along.dot(rays[i].direction) - bins.from) / bins.width;
    if (place < 0.0 || place >= count) continue;
    int& outermost = bins.outermost[static_cast<int>(place)];
    const double beyond = Beyond(edge, rays[i].direction);
    if (outermost < 0 || beyond > Beyond(edge, rays[outermost].direction)) {
      outermost = static_cast<int>(i);
    }
  }
  return bins;
}

// Lays an edge through the outermost returns: h + a u + b u^2 = 0, a circle again.
void FitEdge(const std::vector<Ray>& rays, const Bins& bins, double tolerance, ViewEdge* edge) {
  for (int round = 0; round < kFits; ++round) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    std::vector<Eigen::Vector3d> near;
    for (const int ray : bins.outermost) {
      if (ray < 0 || std::abs(Beyond(*edge, rays[ray].direction)) > tolerance) continue;
      near.push_back(rays[ray].direction);
      mean += near.back();
    }
    if (near.size() < 3 * kLeastEdgeBins) return;
    mean /= near.size();
    // The offset along the normal, and small turns of it about two axes.
    const Eigen::Vector3d across = edge->normal.cross(bins.along);
    Eigen::Matrix3d normal = Eigen::Vector3d(1e-12, 1e-9, 1e-6).asDiagonal();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& direction : near) {
      const Eigen::Vector3d off = direction - mean;
      const Eigen::Vector3d row(1.0, bins.along.dot(off), across.dot(off));
      normal += row * row.transpose();
      right += row * Beyond(*edge, direction);
    }
    const Eigen::Vector3d step = normal.ldlt().solve(right);
    if (!step.allFinite() || std::abs(step[1]) > 0.5 || std::abs(step[2]) > 2.0) return;
    const Eigen::Vector3d turned = edge->normal - step[1] * bins.along - step[2] * across;
    const double level =
        edge->level + step[0] - step[1] * bins.along.dot(mean) - step[2] * across.dot(mean);
    edge->level = level / turned.norm();
    edge->normal = turned.normalized();
  }
}

// Tells whether an edge cuts the piece, and what lies on both sides of it ends there, too.
bool IsEdge(const std::vector<Ray>& rays, const Bins& bins, const ViewEdge& edge,
            double tolerance) {
  const auto count = static_cast<int>(bins.outermost.size());
  const auto ends_there = [&](int k) {
    const int ray = bins.outermost[k];
    return ray >= 0 && std::abs(Beyond(edge, rays[ray].direction)) < tolerance;
  };
  int first = -1, last = -1, cut = 0;
  for (int k = 0; k < count; ++k) {
    if (!ends_there(k) || !rays[bins.outermost[k]].on_piece) continue;
    if (first < 0) first = k;
    last = k, ++cut;
  }
  if (cut < kLeastEdgeBins) return false;
  int at = 0;
  for (int k = first; k <= last; ++k) at += ends_there(k);
  if (at < kStraightEdge * (last - first + 1)) return false;
  const auto are_beside = [&](int k, int step) {
    int beside = 0, gaps = 0;
    for (; k >= 0 && k < count && gaps <= kMostGaps && beside < kLeastEdgeBins; k += step) {
      ++(ends_there(k) ? beside : gaps);
    }
    return beside >= kLeastEdgeBins;
  };
  return are_beside(first - 1, -1) && are_beside(last + 1, 1);
}

}  // namespace

bool View::Sees(const Eigen::Vector2d& place) const {
  if (edges.empty()) return true;
  const Eigen::Vector3d direction = axes.InSpace(place).normalized();
  return std::none_of(edges.begin(), edges.end(),
                      [&](const ViewEdge& edge) { return Beyond(edge, direction) > -margin; });
}

View FindView(const Scan& scan, const PlaneAxes& axes, double diagonal, double spacing) {
  const double away = axes.origin.norm(), step = spacing / away;
  const Eigen::Vector3d middle = axes.origin / away;
  View view;
  view.axes = axes;
  view.margin = kEdgeMargin * step;
  const std::vector<Ray> rays = RaysAround(scan, axes, diagonal);
  for (auto& run : OpenRuns(EndsOfSectors(rays, middle), kViewReach * diagonal / away)) {
    for (std::size_t k = 0; k < kMostEdges && run.size() >= kLeastSectors; ++k) {
      ViewEdge edge;
      if (FirstEdge(rays, run, middle, kRough * step, &edge) < kLeastSectors) break;
      const Bins bins = BinsAlong(rays, edge, middle, step);
      const ViewEdge first = edge;
      FitEdge(rays, bins, kRough * step, &edge);
      if (IsEdge(rays, bins, edge, kFine * step)) view.edges.push_back(edge);
      const auto is_at = [&](int ray) {
        return std::abs(Beyond(first, rays[ray].direction)) < kRough * step;
      };
      run.erase(std::remove_if(run.begin(), run.end(), is_at), run.end());
    }
  }
  return view;
}

}  // namespace atom_core
