#include "scan_plane.h"

#include <pcl/console/print.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/sample_consensus/ransac.h>
#include <pcl/sample_consensus/sac_model_plane.h>

#include <Eigen/Eigenvalues>
#include <utility>

#include "median.h"

namespace atom_core {
namespace {

constexpr int kRansacIterations = 400;
constexpr double kConfidence = 0.9999;  // of RANSAC
constexpr double kLeastSigma = 0.002;   // [m] below, rounding and the board's own flatness count

// Standard deviation about a plane, from the median of the residuals' sizes.
double RobustSigma(const Window& window, const std::vector<int>& chosen, const Plane& plane) {
  std::vector<double> sizes;
  for (const int i : chosen) {
    sizes.push_back(std::abs(plane.Residual(window.At(i).position)));
  }
  return std::max(1.4826 * Median(std::move(sizes)), kLeastSigma);
}

// PCL's plane, without those that pass near the sensor: every single layer is nearly such a plane.
class FacingPlane : public pcl::SampleConsensusModelPlane<pcl::PointXYZ> {
 public:
  FacingPlane(const pcl::PointCloud<pcl::PointXYZ>::ConstPtr& cloud, double least_distance)
      : pcl::SampleConsensusModelPlane<pcl::PointXYZ>(cloud), least_distance_(least_distance) {}

  bool computeModelCoefficients(const std::vector<int>& samples,
                                Eigen::VectorXf& coefficients) const override {
    using Base = pcl::SampleConsensusModelPlane<pcl::PointXYZ>;
    return Base::computeModelCoefficients(samples, coefficients) &&
           std::abs(coefficients[3]) >= least_distance_;
  }

  bool isSampleGood(const std::vector<int>& samples) const override {  // PCL's own complains aloud
    const Eigen::Vector3f first = (*input_)[samples[0]].getVector3fMap();
    const Eigen::Vector3f a = (*input_)[samples[1]].getVector3fMap() - first;
    const Eigen::Vector3f b = (*input_)[samples[2]].getVector3fMap() - first;
    return a.cross(b).norm() > 1e-4f;  // [m^2]
  }

 private:
  double least_distance_;
};

// The plane with the most points among those given; false if there is none.
bool Ransac(const Window& window, const std::vector<int>& among, double threshold,
            double least_distance, Plane* plane) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  for (const int i : among) {
    const Eigen::Vector3f p = window.At(i).position.cast<float>();
    cloud->push_back(pcl::PointXYZ(p.x(), p.y(), p.z()));
  }
  const FacingPlane::Ptr model(new FacingPlane(cloud, least_distance));
  pcl::RandomSampleConsensus<pcl::PointXYZ> ransac(model, threshold);
  ransac.setMaxIterations(kRansacIterations);
  ransac.setProbability(kConfidence);
  const auto verbosity = pcl::console::getVerbosityLevel();
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);  // "no model" is no error here
  const bool found = ransac.computeModel();
  pcl::console::setVerbosityLevel(verbosity);
  if (!found) return false;
  Eigen::VectorXf c;
  ransac.getModelCoefficients(c);
  plane->normal = c.head<3>().cast<double>().normalized();
  plane->distance = -c[3];
  if (plane->distance < 0) plane->normal = -plane->normal, plane->distance = -plane->distance;
  return true;
}

}  // namespace

Plane FitPlane(const Window& window, const std::vector<int>& chosen) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int i : chosen) mean += window.At(i).position;
  mean /= chosen.size();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const int i : chosen) {
    const Eigen::Vector3d offset = window.At(i).position - mean;
    scatter += offset * offset.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  Plane plane;
  plane.normal = solver.eigenvectors().col(0);
  plane.distance = plane.normal.dot(mean);
  if (plane.distance < 0) plane.normal = -plane.normal, plane.distance = -plane.distance;
  plane.sigma = RobustSigma(window, chosen, plane);
  return plane;
}

std::vector<int> OnPlane(const Window& window, const std::vector<int>& among, const Plane& plane,
                         double threshold) {
  std::vector<int> chosen;
  for (const int i : among) {
    if (std::abs(plane.Residual(window.At(i).position)) < threshold) chosen.push_back(i);
  }
  return chosen;
}

std::vector<int> OffPlane(const Window& window, const std::vector<int>& among, const Plane& plane,
                          double threshold) {
  std::vector<int> left;
  for (const int i : among) {
    if (std::abs(plane.Residual(window.At(i).position)) >= threshold) left.push_back(i);
  }
  return left;
}

bool ProposePlane(const Window& window, const std::vector<int>& among, double threshold,
                  double least_distance, Plane* plane) {
  if (among.size() < 3) return false;
  if (!Ransac(window, among, threshold, least_distance, plane)) return false;
  for (int k = 0; k < 3; ++k) {
    const std::vector<int> chosen = OnPlane(window, among, *plane, threshold);
    if (chosen.size() < 3) break;
    const Plane refit = FitPlane(window, chosen);
    if (refit.distance < least_distance) break;
    *plane = refit;
  }
  return true;
}

}  // namespace atom_core
