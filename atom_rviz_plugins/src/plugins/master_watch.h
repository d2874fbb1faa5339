// Whether the ROS master lives, is another one than before, and knows certain services.
#pragma once

#include <QObject>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace atom_rviz {

/// What is known of the master.
struct MasterStatus {
  bool reachable = false;
  int pid = 0;                          ///< of the master's process: another one after a restart
  std::map<std::string, bool> offered;  ///< service to whether somebody offers it

  bool operator==(const MasterStatus& other) const {
    return reachable == other.reachable && pid == other.pid && offered == other.offered;
  }
};

/// Asks the master every second, in a thread of its own: a master that is gone makes callers wait.
class MasterWatch : public QObject {
  Q_OBJECT
 public:
  /// Begin to ask, also for `services`.
  ///
  /// `subscribe` is run for each new master, which knows nothing of this node's topics: in the
  /// thread that asks, since a master that goes away just then makes it wait.
  MasterWatch(const std::vector<std::string>& services, const std::function<void()>& subscribe);
  ~MasterWatch() override;

  /// The newest answer; only for the thread of the window.
  const MasterStatus& status() const { return status_; }

 Q_SIGNALS:
  /// Something of the status has changed, or it is known for the first time.
  void changed();

 private:
  void ask_again_and_again(const std::vector<std::string>& services,
                           const std::function<void()>& subscribe);
  void take(const MasterStatus& status);

  MasterStatus status_;
  bool known_ = false;
  std::mutex lock_;
  std::condition_variable end_;
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace atom_rviz
