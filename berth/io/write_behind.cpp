#include "berth/io/write_behind.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string_view>
#include <utility>

#include "berth/base/thread.hpp"

namespace berth::io {

class WriteBehind::State {
 public:
  explicit State(Options options) : options_(std::move(options)) {}

  void add(int descriptor, std::string text) {
    const std::scoped_lock lock(mutex_);
    if (broken_.contains(descriptor)) return;
    if (kept_bytes_ + text.size() > options_.most_bytes) return lose(text);
    kept_bytes_ += text.size();
    texts_.push_back({descriptor, std::move(text), 0});
    bell_.notify_one();
  }

  int broken(int descriptor) const {
    const std::scoped_lock lock(mutex_);
    const auto found = broken_.find(descriptor);
    return found == broken_.end() ? 0 : found->second;
  }

  void run() {
    while (auto next = taken()) {
      if (next->lost == 0) {
        write_all(next->descriptor, next->text);
      } else if (options_.lost) {
        write_all(options_.told_at, options_.lost(next->lost));
      }
      const std::scoped_lock lock(mutex_);
      kept_bytes_ -= next->text.size();
    }
  }

  /// False: the reader takes nothing.
  bool end() {
    std::unique_lock lock(mutex_);
    ending_ = true;
    bell_.notify_one();
    std::size_t before = writes_;
    while (done_.wait_for(lock, options_.patience, [&] { return ended_ || writes_ != before; })) {
      if (ended_) return true;
      before = writes_;
    }
    texts_.clear();
    abandoned_ = true;
    return false;
  }

 private:
  struct Text {
    int descriptor;
    std::string text;
    std::size_t lost;  // lines, in the place of the text
  };

  // With the lock.
  void lose(std::string_view text) {
    const auto lines = static_cast<std::size_t>(std::ranges::count(text, '\n'));
    if (texts_.empty() || texts_.back().lost == 0) texts_.push_back({-1, {}, 0});
    texts_.back().lost += lines;
  }

  // The next to be written; none: the end.
  std::optional<Text> taken() {
    std::unique_lock lock(mutex_);
    bell_.wait(lock, [this] { return ending_ || !texts_.empty(); });
    if (texts_.empty()) {
      ended_ = true;
      done_.notify_one();
      return std::nullopt;
    }
    Text next = std::move(texts_.front());
    texts_.pop_front();
    return next;
  }

  void write_all(int descriptor, std::string_view text) {
    int failed = broken(descriptor);
    while (!text.empty() && failed == 0) {
      const auto written = ::write(descriptor, text.data(), text.size());
      if (written < 0 && errno != EINTR) failed = errno;
      if (written > 0) text.remove_prefix(static_cast<std::size_t>(written));
      const std::scoped_lock lock(mutex_);
      ++writes_;
      done_.notify_one();
      if (abandoned_) return;
    }
    const std::scoped_lock lock(mutex_);
    if (failed != 0) broken_.emplace(descriptor, failed);
  }

  const Options options_;
  mutable std::mutex mutex_;
  std::condition_variable bell_;  // for the thread
  std::condition_variable done_;  // for `end`
  std::deque<Text> texts_;
  std::size_t kept_bytes_ = 0;
  std::size_t writes_ = 0;
  std::map<int, int> broken_;  // errno
  bool ending_ = false;
  bool ended_ = false;
  bool abandoned_ = false;  // the descriptors may be others' by now
};

WriteBehind::WriteBehind(Options options)
    : state_(std::make_shared<State>(std::move(options))),
      thread_(thread_without_signals([state = state_] { state->run(); })) {}

void WriteBehind::finish() {
  if (!good()) return;
  if (state_->end()) {
    thread_.join();
  } else {
    thread_.detach();
  }
}

void WriteBehind::add(int descriptor, std::string text) { state_->add(descriptor, std::move(text)); }

int WriteBehind::broken(int descriptor) const { return state_->broken(descriptor); }

}  // namespace berth::io
