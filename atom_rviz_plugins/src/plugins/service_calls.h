// Calls of services that never make the window wait.
#pragma once

#include <QObject>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#ifndef Q_MOC_RUN
#include <ros/ros.h>
#endif

namespace atom_rviz {

/// Calls services in threads of their own; answers come back in the thread of the window.
///
/// A service that does not answer in time is given up. Destroying this object gives up all calls.
class ServiceCalls : public QObject {
 public:
  explicit ServiceCalls(QObject* parent = nullptr) : QObject(parent) {}
  ~ServiceCalls() override;

  /// Call a service whose answer has `success` and `message`.
  ///
  /// `done(success, message)` is run in the window's thread, unless this object is gone by then.
  /// When there was no answer `success` is false and the message says why.
  template <class Service>
  void call(const std::string& name, const Service& service,
            const std::function<void(bool, std::string)>& done) {
    start(name, done, [name, service = Service(service)](Call& call) mutable {
      if (!ros::service::exists(name, false)) {
        call.message = "nobody offers " + name + "; is its node running?";
        return;
      }
      if (!open(call, ros::NodeHandle().serviceClient<Service>(name, true))) return;
      if (!call.client.call(service)) {
        call.message = name + " failed; its node's output tells more";
        return;
      }
      call.success = service.response.success;
      call.message = service.response.message;
    });
  }

 private:
  struct Call {
    std::string name;
    std::thread thread;
    std::mutex lock;  // of client and given_up
    ros::ServiceClient client;
    bool given_up = false;
    bool finished = false;  // the thread has nothing left to do; the window's thread only
    bool success = false;
    std::string message;
  };

  void start(const std::string& name, const std::function<void(bool, std::string)>& done,
             const std::function<void(Call&)>& run);
  static bool open(Call& call, const ros::ServiceClient& client);
  static void give_up(Call& call);
  void forget_finished();

  std::list<std::shared_ptr<Call>> calls_;
};

}  // namespace atom_rviz
