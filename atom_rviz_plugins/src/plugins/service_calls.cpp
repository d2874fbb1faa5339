#include "plugins/service_calls.h"

#include <QTimer>

namespace atom_rviz {
namespace {

constexpr int kPatience_ms = 15000;  // a collection takes a second or two to write

}  // namespace

ServiceCalls::~ServiceCalls() {
  for (const auto& call : calls_) give_up(*call);
  for (const auto& call : calls_) call->thread.join();
}

void ServiceCalls::start(const std::string& name,
                         const std::function<void(bool, std::string)>& done,
                         const std::function<void(Call&)>& run) {
  forget_finished();
  auto call = std::make_shared<Call>();
  call->name = name;
  calls_.push_back(call);
  call->thread = std::thread([this, call, done, run] {
    try {
      run(*call);
    } catch (const std::exception& error) {  // a name that roscpp does not know as one
      call->success = false;
      call->message = call->name + " cannot be called: " + error.what();
    }
    QMetaObject::invokeMethod(
        this,
        [call, done] {
          call->finished = true;
          if (call->given_up && !call->success) {
            call->message = call->name + " gave no answer; its node may hang";
          }
          done(call->success, call->message);
        },
        Qt::QueuedConnection);
  });
  QTimer::singleShot(kPatience_ms, this, [call] {
    if (!call->finished) give_up(*call);
  });
}

bool ServiceCalls::open(Call& call, const ros::ServiceClient& client) {
  const std::lock_guard<std::mutex> guard(call.lock);
  if (call.given_up) return false;
  call.client = client;
  return true;
}

void ServiceCalls::give_up(Call& call) {
  const std::lock_guard<std::mutex> guard(call.lock);
  call.given_up = true;
  call.client.shutdown();  // drops the connection, which ends a call that waits on it
}

void ServiceCalls::forget_finished() {
  for (auto call = calls_.begin(); call != calls_.end();) {
    if ((*call)->finished) {
      (*call)->thread.join();
      call = calls_.erase(call);
    } else {
      ++call;
    }
  }
}

}  // namespace atom_rviz
