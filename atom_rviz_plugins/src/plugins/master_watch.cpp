#include "plugins/master_watch.h"

#include <ros/master.h>
#include <ros/this_node.h>

#include <chrono>

namespace atom_rviz {
namespace {

constexpr std::chrono::seconds kPeriod(1);

bool ask(const std::string& method, const std::string& argument, XmlRpc::XmlRpcValue& answer) {
  XmlRpc::XmlRpcValue arguments, response;
  arguments[0] = ros::this_node::getName();
  if (!argument.empty()) arguments[1] = argument;
  return ros::master::execute(method, arguments, response, answer, false);
}

MasterStatus asked(const std::vector<std::string>& services) {
  MasterStatus status;
  XmlRpc::XmlRpcValue answer;
  status.reachable = ask("getPid", "", answer);
  if (!status.reachable) return status;
  if (answer.getType() == XmlRpc::XmlRpcValue::TypeInt) status.pid = answer;
  for (const std::string& service : services) {
    XmlRpc::XmlRpcValue uri;
    status.offered[service] = ask("lookupService", service, uri);
  }
  return status;
}

}  // namespace

MasterWatch::MasterWatch(const std::vector<std::string>& services,
                         const std::function<void()>& subscribe)
    : thread_(&MasterWatch::ask_again_and_again, this, services, subscribe) {}

MasterWatch::~MasterWatch() {
  {
    const std::lock_guard<std::mutex> guard(lock_);
    ending_ = true;
  }
  end_.notify_all();
  thread_.join();
}

void MasterWatch::ask_again_and_again(const std::vector<std::string>& services,
                                      const std::function<void()>& subscribe) {
  int last_pid = 0;
  std::unique_lock<std::mutex> guard(lock_);
  while (!ending_) {
    guard.unlock();
    const MasterStatus status = asked(services);
    if (status.reachable && status.pid != last_pid) {
      last_pid = status.pid;
      subscribe();
    }
    QMetaObject::invokeMethod(
        this, [this, status] { take(status); }, Qt::QueuedConnection);
    guard.lock();
    end_.wait_for(guard, kPeriod, [this] { return ending_; });
  }
}

void MasterWatch::take(const MasterStatus& status) {
  if (known_ && status == status_) return;
  known_ = true;
  status_ = status;
  Q_EMIT changed();
}

}  // namespace atom_rviz
