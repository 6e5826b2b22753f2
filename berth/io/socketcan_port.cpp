#include "berth/io/socketcan_port.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "berth/io/controller_status.hpp"
#include "berth/io/deliveries.hpp"
#include "berth/io/echo_filter.hpp"
#include "berth/io/kernel_queue.hpp"
#include "berth/io/link_news.hpp"
#include "berth/io/socket_reader.hpp"
#include "berth/io/socketcan_codec.hpp"
#include "berth/io/socketcan_setup.hpp"
#include "berth/io/socketcan_socket.hpp"
#include "berth/io/written_frames.hpp"
#include "berth/rt/later.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t most_events = 1024;   // read and not yet delivered; the rest stays in the kernel's buffer
constexpr rt::Duration look_again = 1s;     // until counters, and whether an interface is back, are asked again
constexpr rt::Duration open_patience = 2s;  // until a controller must be running
constexpr rt::Duration restart_patience = 250ms;

bool changes_for_listening(const Link& link, const Steps& steps, const Wanted& wanted) noexcept {
  return wanted.listen_only && link.controller() && !steps.none();
}

Link down(Link link) {
  link.up = false;
  return link;
}

/// Frames that the receive buffers of this socket and of earlier ones lost.
class Losses {
 public:
  /// For each status that is asked for: asks the kernel, but not too often.
  void ask(CanSocket& socket, rt::Time now) noexcept {
    if (now - asked_ < 100ms) return;
    asked_ = now;
    socket.ask_dropped();
  }
  void end(CanSocket& socket) noexcept { before_ += socket.ask_dropped(); }
  [[nodiscard]] std::uint32_t so_far(const CanSocket& socket) const noexcept { return before_ + socket.dropped(); }

 private:
  std::uint32_t before_ = 0;
  rt::Time asked_{};
};

}  // namespace

/// Reads frames between jobs, and delivers one per job.
class SocketCanPort::Impl final : private Watcher, private LinkNews::Owner, private KernelQueue::Owner {
 public:
  Impl(Loop& loop, std::string name, const Wanted& wanted)
      : loop_(&loop),
        executor_(&loop.executor()),
        name_(std::move(name)),
        wanted_(wanted),
        news_(loop, name_, *this),
        status_(wanted.bit_rate),
        queue_(loop, socket_, *this, status_, queue_depth, *this) {}
  ~Impl() {
    unbind();
    if (!put_back_) return;
    const auto now = read_link(name_);
    if (now) put_back(*now, *put_back_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // `before`: the state to restore at the end. False: errno says why.
  bool start(const Link& link, std::optional<Link> before) {
    put_back_ = std::move(before);
    if (!news_.open()) return false;
    link_ = link;
    if (!bind()) return false;
    learn(link);
    deliveries_.clear();
    return true;
  }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept {
    KernelFrame bytes;
    const std::size_t size = encode_frame(frame, bytes);
    const can::Status& now = status_.now();
    if (!now.up || size == 0 || (size == fd_size && link_.mtu < fd_size)) return can::Queued::closed;
    if (now.listen_only) return can::Queued::listen_only;
    if (now.bus_off) return can::Queued::bus_off;
    if (tag != 0) {
      // For a user that never asks when a frame was sent, own frames need not be read.
      if (!hears_own_ && there_) hears_own_ = socket_.hear_own();
      if (filter_.expect(frame.key())) install();
    }
    return queue_.push(frame, tag);
  }

  void withdraw(std::uint32_t tag) noexcept {
    if (tag == 0) return;
    queue_.withdraw(tag);
    written_.withdraw(tag);
  }

  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
    deliveries_.listen(listener, accept);
    if (!filter_.covers(deliveries_.accept())) install();
  }

  can::Status status() noexcept {
    if (there_) losses_.ask(socket_, executor_->now());
    can::Status s = status_.now();
    s.queued = static_cast<std::uint16_t>(queue_.size() + written_.size());
    s.lost = losses_.so_far(socket_) + status_.overflows();
    return s;
  }

  bool restart(std::uint32_t bit_rate) noexcept {
    trouble_.clear();
    drop_queue();
    if (bit_rate == 0 || !there_) {
      trouble_ = bit_rate == 0 ? name_ + ": 0 is not a bit rate" : name_ + ": there is no such interface";
      return false;
    }
    wanted_.bit_rate = bit_rate;
    if (status_.now().bus_off && link_.controller() && bit_rate == link_.bit_rate &&
        link_.listen_only == wanted_.listen_only) {
      return out_of_bus_off();
    }
    const Steps steps = steps_to(link_, wanted_, true);
    if (steps.none()) {
      if (!link_.controller()) {
        status_.label(bit_rate);
        tell_changed();
      }
      return status_.now().up;
    }
    if (changes_for_listening(link_, steps, wanted_) && !put_back_) put_back_ = link_;
    const auto now = set_up(link_, steps, wanted_, restart_patience);
    return settle(now);
  }

  [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }

 private:
  // ---- the interface ----

  bool bind() {
    if (!socket_.open(link_.index)) return false;
    if (!loop_->watch(socket_.fd(), *this, EPOLLIN)) {
      socket_.close();
      return false;
    }
    there_ = true;
    news_.know(link_.index);
    queue_.bound();
    if (hears_own_) hears_own_ = socket_.hear_own();
    install();
    return true;
  }

  void unbind() noexcept {
    if (socket_.fd() < 0) return;
    losses_.end(socket_);
    loop_->forget(socket_.fd());
    socket_.close();
    there_ = false;
  }

  // Takes the present state of the interface, and reports the changes to the listener.
  void learn(const Link& link) {
    const bool was_up = status_.now().up;
    link_ = link;
    news_.know(link.index);
    const bool changed = status_.learn(link, wanted_, there_);
    if (was_up && !status_.now().up) drop_queue();
    if (status_.now().up) trouble_.clear();
    if (status_.unseen(link_) && !look_.timed()) look_.arm(look_again);
    if (changed) tell_changed();
  }

  void goes_down() noexcept override {
    drop_queue();
    news_.ask();
    look_.arm(look_again);
    if (!status_.went_down()) return;
    trouble_ = name_ + " went down; " + ip_command(down(link_), wanted_);
    tell_changed();
  }

  void vanishes() {
    if (!there_ && !status_.now().up) return;
    read_all();  // frames that came before
    drop_queue();
    unbind();
    trouble_ = name_ + ": there is no such interface any more";
    if (status_.went_down()) tell_changed();
  }

  void answered(const LinkNotice& notice) override {
    if (notice.kind == LinkNotice::Kind::reply && notice.error != 0) return vanishes();
    if (notice.kind != LinkNotice::Kind::link || notice.link.name != name_) return;
    if (there_ && notice.link.index != link_.index) vanishes();  // another interface of the same name is there
    if (!there_) {
      if (!notice.link.can) return;
      link_ = notice.link;
      if (!bind()) {
        trouble_ = name_ + ": " + std::strerror(errno);
        return;
      }
    }
    learn(notice.link);
  }

  void look() noexcept {
    if (!status_.unseen(link_)) return;
    look_.arm(look_again);
    news_.ask();
  }

  bool out_of_bus_off() {
    if (link_.restart_ms != 0) return true;  // the kernel restarts it by itself, and nobody else may
    const auto done = apply(link_.index, {.restart = true});
    if (!done) {
      trouble_ = name_ + ": the controller is bus-off and cannot be started again: " + done.error().text +
                 (done.error().not_allowed() ? "; as root: ip link set " + name_ + " type can restart" : "");
      return false;
    }
    const auto now = read_link(name_);
    if (!now) return false;
    learn(*now);
    status_.clear_counters();
    news_.ask();
    return true;
  }

  // This port set the interface up, or tried to. That the interface went down in between is not reported.
  bool settle(const tl::expected<Link, std::string>& now) {
    int error = 0;
    socklen_t size = sizeof error;
    ::getsockopt(socket_.fd(), SOL_SOCKET, SO_ERROR, &error, &size);
    if (now) {
      learn(*now);
    } else {
      const auto is = read_link(name_);
      if (is) learn(*is);
      trouble_ = now.error();
    }
    news_.ask();
    return now && status_.now().up;
  }

  // ---- out ----

  // Only frames that pass the filter come back.
  void wrote(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (hears_own_ && filter_.passes(frame.key())) written_.add(frame, tag);
  }

  void drop_queue() noexcept {
    queue_.clear();
    written_.clear();
  }

  // ---- in ----

  void ready(std::uint32_t events) noexcept override {
    freed_ = false;
    read_all();
    if ((events & EPOLLOUT) != 0 || (freed_ && queue_.size() > 0)) queue_.flush();
  }

  void read_all() noexcept {
    reader_.read([&] { return most_events - std::min(most_events, deliveries_.size()); },
                 [&](const CanSocket::Received& r, rt::Time at) { arrived(r, at); }, [&] { goes_down(); });
  }

  void arrived(const CanSocket::Received& r, rt::Time at) noexcept {
    const auto frame = decode_frame(r.bytes);
    if (!frame) {
      const auto report = decode_error(r.bytes);
      if (!report) return;
      if (report->error) deliveries_.error(error_frame(r.bytes), at);
      heard_error(*report, at);
    } else if (r.own) {
      freed_ = true;
      written_.echoed(*frame, socket_.dropped(), [&](std::uint32_t tag) { deliveries_.sent(tag, at); });
    } else {
      if (filter_.much(frame->key(), deliveries_.accept())) install();
      deliveries_.received(*frame, at);
    }
  }

  void heard_error(const BusReport& report, rt::Time at) noexcept {
    const bool changed = status_.learn(report);
    if (report.bus_off) drop_queue();
    if (report.restarted || report.bus_off) news_.ask();
    if (changed) tell_changed(at);
  }

  // ---- acceptance ----

  void install() noexcept {
    const auto& passing = filter_.install(deliveries_.accept());
    if (!there_ || socket_.filter(kernel_filters(passing, most_filters))) return;
    const KernelFilter everything;
    socket_.filter({&everything, 1});
  }

  // ---- to the listener ----

  void tell_changed(std::optional<rt::Time> at = std::nullopt) noexcept {
    const rt::Time when = at ? *at : reader_.happens();
    if (deliveries_.anybody()) deliveries_.changed(status(), when);
  }

  Loop* loop_;
  rt::Executor* executor_;
  std::string name_;
  Wanted wanted_;
  Link link_;
  bool there_ = false;  // bound to an interface that exists, up or not
  std::optional<Link> put_back_{};
  CanSocket socket_;
  LinkNews news_;
  ControllerStatus status_;
  Losses losses_;
  std::string trouble_;
  SocketReader reader_{*loop_, socket_};
  EchoFilter filter_;
  WrittenFrames written_{most_unconfirmed};
  bool hears_own_ = false;
  bool freed_ = false;  // the kernel's queue has become shorter
  Deliveries deliveries_{*executor_};
  KernelQueue queue_;
  rt::Later<Impl, &Impl::look> look_{*this, *executor_};
};

namespace {

std::string no_socket(const std::string& name) {
  const int why = errno;
  if (why == EAFNOSUPPORT || why == EPROTONOSUPPORT)
    return name + ": this kernel has no SocketCAN (" + std::strerror(why) + "); as root: modprobe can-raw";
  return name + ": " + std::strerror(why);
}

tl::expected<Link, std::string> usable(const Link& link, const Wanted& wanted) {
  if (link.up && link.running) return link;
  if (link.up && link.state == CanState::bus_off) return link;
  if (link.up) return tl::unexpected(link.name + ": is up and not running: is the adapter's cable in?");
  return tl::unexpected(link.name + ": is down; as root: " + ip_command(link, wanted));
}

}  // namespace

tl::expected<std::unique_ptr<SocketCanPort>, std::string> SocketCanPort::open(Loop& loop, const std::string& interface,
                                                                              const PortOptions& options) {
  const auto found = find_interface(interface);
  if (!found) return tl::unexpected(found.error());
  const Wanted wanted{options.bit_rate, options.listen_only};
  const Steps steps = steps_to(*found, wanted, false);
  auto link = found;
  if (!steps.none()) link = set_up(*found, steps, wanted, open_patience);
  if (link) link = usable(*link, wanted);
  if (!link) return tl::unexpected(link.error());
  auto impl = std::make_unique<Impl>(loop, interface, wanted);
  const bool changes = changes_for_listening(*found, steps, wanted);
  if (!impl->start(*link, changes ? std::optional(*found) : std::nullopt)) return tl::unexpected(no_socket(interface));
  return std::unique_ptr<SocketCanPort>(new SocketCanPort(std::move(impl)));
}

SocketCanPort::SocketCanPort(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
SocketCanPort::~SocketCanPort() = default;
can::Queued SocketCanPort::send(const can::Frame& frame, std::uint32_t tag) noexcept { return impl_->send(frame, tag); }
void SocketCanPort::withdraw(std::uint32_t tag) noexcept { impl_->withdraw(tag); }
void SocketCanPort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  impl_->listen(listener, accept);
}
can::Status SocketCanPort::status() const noexcept { return impl_->status(); }
bool SocketCanPort::restart(std::uint32_t bit_rate) noexcept { return impl_->restart(bit_rate); }
const std::string& SocketCanPort::trouble() const noexcept { return impl_->trouble(); }

}  // namespace berth::io
