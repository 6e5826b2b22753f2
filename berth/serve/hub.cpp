#include "berth/serve/hub.hpp"

#include <algorithm>
#include <deque>
#include <vector>

namespace berth::serve {

using namespace std::chrono_literals;

class Hub::Impl final : private can::Listener, private rt::Job {
 public:
  Impl(rt::Executor& executor, std::unique_ptr<can::Port> port) : executor_(&executor), port_(std::move(port)) {
    static constexpr can::IdRange everything[] = {can::all_base, can::all_extended};
    port_->listen(this, everything);
  }
  ~Impl() { port_->listen(nullptr, {}); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[nodiscard]] rt::Executor& executor() const noexcept { return *executor_; }
  [[nodiscard]] can::Port& port() const noexcept { return *port_; }
  [[nodiscard]] std::size_t users() const noexcept { return users_.size(); }
  void tap(can::Tap* tap) noexcept { tap_ = tap; }
  void add(User& user) { users_.push_back(&user); }
  void remove(User& user) noexcept;
  void pump() noexcept;
  bool restart(std::uint32_t bit_rate) noexcept;

 private:
  static constexpr std::size_t most_given = 16;  // frames in the port at once: few, so that the users take turns
  struct Given {
    std::uint32_t tag = 0;
    User* user = nullptr;  // null: it has left
    std::uint32_t theirs = 0;
    can::Frame frame;
  };

  // A port may drop frames without a report. When its queue is empty, nobody waits for them any longer.
  void run() noexcept override {
    if (port_->status().queued == 0) given_.clear();
    pump();
  }
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;

  rt::Executor* executor_;
  std::unique_ptr<can::Port> port_;
  can::Tap* tap_ = nullptr;
  std::vector<User*> users_;
  std::size_t turn_ = 0;
  std::vector<Given> given_;
  std::uint32_t last_ = 0;

 public:
  void forget(const User& user, std::uint32_t theirs) noexcept {
    for (auto& g : given_) {
      if (g.user == &user && g.theirs == theirs) g.theirs = 0;
    }
  }
};

class Hub::User final : public can::Port, private rt::Job {
 public:
  explicit User(Impl& hub) : hub_(&hub) { hub_->add(*this); }
  ~User() override { hub_->remove(*this); }
  User(const User&) = delete;
  User& operator=(const User&) = delete;

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    const auto s = hub_->port().status();
    if (!s.up) return can::Queued::closed;
    if (s.bus_off) return can::Queued::bus_off;
    if (s.listen_only) return can::Queued::listen_only;
    if (waiting.size() >= queue_depth) return can::Queued::full;
    waiting.push_back({frame, tag});
    hub_->pump();
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    if (tag == 0) return;
    if (std::erase_if(waiting, [tag](const Waiting& w) { return w.tag == tag; }) == 0) hub_->forget(*this, tag);
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accept_.assign(accept.begin(), accept.end());
  }
  [[nodiscard]] can::Status status() const noexcept override {
    auto s = hub_->port().status();
    s.queued = static_cast<std::uint16_t>(waiting.size());
    s.lost += lost_;
    return s;
  }
  bool restart(std::uint32_t bit_rate) noexcept override {
    waiting.clear();
    return hub_->restart(bit_rate);
  }

  struct Waiting {
    can::Frame frame;
    std::uint32_t tag = 0;
  };
  std::deque<Waiting> waiting;

  void hear(const can::Frame& frame, rt::Time at) {
    if (listener_ == nullptr) return;
    const auto passes = [key = frame.key()](const can::IdRange& r) { return r.contains(key); };
    if (!std::ranges::any_of(accept_, passes)) return;
    if (events_.size() >= events_kept) {
      ++lost_;
      return;
    }
    push({What::received, frame, 0, at});
  }
  void confirm(std::uint32_t tag, rt::Time at) {
    if (tag != 0) push({What::sent, {}, tag, at});
  }
  void tell(rt::Time at) { push({What::changed, {}, 0, at}); }

 private:
  enum class What : std::uint8_t { received, sent, changed };
  struct Event {
    What what;
    can::Frame frame;
    std::uint32_t tag;
    rt::Time at;
  };
  void push(Event event) {
    events_.push_back(event);
    hub_->executor().post(*this);
  }
  // One call per job.
  void run() noexcept override {
    if (events_.empty()) return;
    const Event event = events_.front();
    events_.pop_front();
    if (!events_.empty()) hub_->executor().post(*this);
    if (listener_ == nullptr) return;
    switch (event.what) {
      case What::received: return listener_->received(event.frame, event.at);
      case What::sent: return listener_->sent(event.tag, event.at);
      case What::changed: return listener_->changed(status(), event.at);
    }
  }

  Impl* hub_;
  can::Listener* listener_ = nullptr;
  std::vector<can::IdRange> accept_;
  std::deque<Event> events_;
  std::uint32_t lost_ = 0;
};

void Hub::Impl::remove(User& user) noexcept {
  std::erase(users_, &user);
  for (auto& g : given_) {
    if (g.user == &user) g.user = nullptr;
  }
}

// One frame of each user in turn, as long as the port takes them.
void Hub::Impl::pump() noexcept {
  for (std::size_t idle = 0; idle < users_.size() && given_.size() < most_given;) {
    turn_ = (turn_ + 1) % users_.size();
    User& user = *users_[turn_];
    if (user.waiting.empty()) {
      ++idle;
      continue;
    }
    const auto& next = user.waiting.front();
    const auto queued = port_->send(next.frame, last_ + 1);
    if (queued == can::Queued::full) {
      turn_ = (turn_ + users_.size() - 1) % users_.size();  // it is this one's turn again
      if (given_.empty()) executor_->after(2ms, *this);
      return;
    }
    if (queued == can::Queued::yes) given_.push_back({++last_, &user, next.tag, next.frame});
    user.waiting.pop_front();
    if (last_ == 0xFFFF'FFFEU) last_ = 0;
    idle = 0;
  }
  if (given_.size() >= most_given && !timed()) executor_->after(100ms, *this);
}

void Hub::Impl::received(const can::Frame& frame, rt::Time at) noexcept {
  if (tap_ != nullptr) tap_->frame(frame, at, -1);
  for (auto* const user : users_) user->hear(frame, at);
}

void Hub::Impl::sent(std::uint32_t tag, rt::Time at) noexcept {
  const auto it = std::ranges::find(given_, tag, &Given::tag);
  if (it == given_.end()) return;
  const Given done = *it;
  given_.erase(it);
  if (tap_ != nullptr) tap_->frame(done.frame, at, 0);
  for (auto* const user : users_) {
    if (user != done.user) user->hear(done.frame, at);
  }
  if (done.user != nullptr) done.user->confirm(done.theirs, at);
  pump();
}

void Hub::Impl::changed(const can::Status& status, rt::Time at) noexcept {
  if (!status.up || status.bus_off) {
    given_.clear();
    for (auto* const user : users_) user->waiting.clear();
  }
  for (auto* const user : users_) user->tell(at);
}

bool Hub::Impl::restart(std::uint32_t bit_rate) noexcept {
  const auto s = port_->status();
  if (!s.bus_off) return s.bit_rate == bit_rate;
  given_.clear();
  return port_->restart(s.bit_rate);
}

Hub::Hub(rt::Executor& executor, std::unique_ptr<can::Port> port)
    : impl_(std::make_unique<Impl>(executor, std::move(port))) {}
Hub::~Hub() = default;
std::unique_ptr<can::Port> Hub::attach() { return std::make_unique<User>(*impl_); }
void Hub::tap(can::Tap* tap) noexcept { impl_->tap(tap); }
const can::Port& Hub::port() const noexcept { return impl_->port(); }
std::size_t Hub::users() const noexcept { return impl_->users(); }

}  // namespace berth::serve
