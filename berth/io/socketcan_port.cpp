#include "berth/io/socketcan_port.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <deque>
#include <vector>

#include "berth/can/ranges.hpp"
#include "berth/io/deliveries.hpp"
#include "berth/io/netlink_socket.hpp"
#include "berth/io/socketcan_codec.hpp"
#include "berth/io/socketcan_setup.hpp"
#include "berth/io/socketcan_socket.hpp"
#include "berth/rt/later.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;
using Level = BusReport::Level;

constexpr std::size_t most_events = 1024;     // read and not yet delivered; the rest stays in the kernel's buffer
constexpr unsigned most_batches = 8;          // read at a stretch, before others have their turn
constexpr std::size_t most_echoed = 256;      // identifiers sent with a tag; then every echo is read
constexpr unsigned most_passed = 32;          // echoes of later frames until one is given up: more than mailboxes are
constexpr std::uint32_t much_unwanted = 256;  // frames that passed a filter and are not wanted; then it is narrowed
constexpr rt::Duration look_again = 1s;       // a controller's counters, and whether an interface is back
constexpr rt::Duration count_again = 100ms;   // when the status is asked for: the losses so far
constexpr rt::Duration open_patience = 2s;    // for a controller to be running
constexpr rt::Duration restart_patience = 250ms;
constexpr std::uint32_t first_sequence = 0xBE00'0000U;  // others count theirs from small numbers or the time

std::int64_t wall_clock() noexcept {
  timespec time{};
  ::clock_gettime(CLOCK_REALTIME, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

Level level_of(const can::Status& s) noexcept {
  if (s.error_passive()) return Level::passive;
  return s.tec >= 96 || s.rec >= 96 ? Level::warning : Level::active;
}

bool changes_for_listening(const Link& link, const Steps& steps, const Wanted& wanted) noexcept {
  return wanted.listen_only && link.controller() && !steps.none();
}

}  // namespace

/// Frames are read between jobs, and delivered one per job.
class SocketCanPort::Impl final : private Watcher {
 public:
  Impl(Loop& loop, std::string name, const Wanted& wanted)
      : loop_(&loop), executor_(&loop.executor()), name_(std::move(name)), wanted_(wanted), links_ear_(*this) {
    status_.bit_rate = wanted.bit_rate;
  }
  ~Impl() {
    unbind();
    if (links_.fd() >= 0) loop_->forget(links_.fd());
    if (!put_back_) return;
    const auto now = read_link(name_);
    if (now) put_back(*now, *put_back_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // False: errno says why.
  bool start(const Link& link) {
    if (!links_.open() || !loop_->watch(links_.fd(), links_ear_, EPOLLIN)) return false;
    link_ = link;
    if (!bind()) return false;
    learn(link);
    deliveries_.clear();
    return true;
  }
  void was(const Link& before) { put_back_ = before; }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept {
    KernelFrame bytes;
    const std::size_t size = encode_frame(frame, bytes);
    if (!status_.up || size == 0 || (size == fd_size && link_.mtu < fd_size)) return can::Queued::closed;
    if (status_.listen_only) return can::Queued::listen_only;
    if (status_.bus_off) return can::Queued::bus_off;
    if (tag != 0) expect_echo(frame.key());
    // Written when the job that sends is over: a service that says "I am here" has then also said what it wants to
    // hear, and the answer passes the kernel's filter.
    const bool first = waiting_.empty();
    if (first) write_.post();
    if (waiting_.size() >= queue_depth && !stuck_) flush();
    return keep(frame, tag);
  }

  void withdraw(std::uint32_t tag) noexcept {
    if (tag == 0) return;
    std::erase_if(waiting_, [tag](const Given& g) { return g.tag == tag; });
    for (auto& written : written_) {
      if (written.tag == tag) written.tag = 0;
    }
  }

  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
    deliveries_.listen(listener, accept);
    if (!can::covers(installed_, deliveries_.accept())) install();
  }

  can::Status status() noexcept {
    if (there_ && executor_->now() - counted_ >= count_again) {
      counted_ = executor_->now();
      socket_.ask_dropped();
    }
    can::Status s = status_;
    s.queued = static_cast<std::uint16_t>(waiting_.size() + written_.size());
    s.lost = lost_before_ + socket_.dropped() + overflows_;
    return s;
  }

  bool restart(std::uint32_t bit_rate) noexcept {
    trouble_.clear();
    drop_queue();
    if (bit_rate == 0 || !there_) {
      trouble_ = bit_rate == 0 ? name_ + ": a bit rate of 0 is none" : name_ + ": there is no such interface";
      return false;
    }
    wanted_.bit_rate = bit_rate;
    if (status_.bus_off && link_.controller() && bit_rate == link_.bit_rate &&
        link_.listen_only == wanted_.listen_only) {
      return out_of_bus_off();
    }
    const Steps steps = steps_to(link_, wanted_, true);
    if (steps.none()) {
      if (!link_.controller()) learn_label();
      return status_.up;
    }
    if (changes_for_listening(link_, steps, wanted_) && !put_back_) put_back_ = link_;
    const auto now = set_up(link_, steps, wanted_, restart_patience);
    return settle(now);
  }

  [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }

 private:
  struct Given {
    can::Frame frame;
    std::uint32_t tag;
    unsigned passed = 0;  // echoes of frames that were written later
  };
  class LinksEar final : public Watcher {
   public:
    explicit LinksEar(Impl& impl) noexcept : impl_(&impl) {}
    void ready(std::uint32_t) noexcept override { impl_->hear_links(); }

   private:
    Impl* impl_;
  };

  // ---- the interface ----

  bool bind() {
    if (!socket_.open(link_.index)) return false;
    if (!loop_->watch(socket_.fd(), *this, EPOLLIN)) {
      socket_.close();
      return false;
    }
    there_ = true;
    watches_out_ = false;
    if (hears_own_) hears_own_ = socket_.hear_own();
    install();
    return true;
  }

  void unbind() noexcept {
    if (socket_.fd() < 0) return;
    lost_before_ += socket_.ask_dropped();
    loop_->forget(socket_.fd());
    socket_.close();
    there_ = false;
  }

  // How the interface is now; tells the listener what that changes.
  void learn(const Link& link) {
    const can::Status before = status_;
    const Level level = level_of(status_);
    link_ = link;
    if (link.state) status_.bus_off = link.state == CanState::bus_off;
    status_.up = there_ && link.up && (link.running || status_.bus_off);
    status_.listen_only = wanted_.listen_only || link.listen_only;
    status_.bit_rate_is_label = link.bit_rate == 0;
    status_.bit_rate = link.bit_rate != 0 ? link.bit_rate : wanted_.bit_rate;
    status_.knows_sent = link.echo || link.kind == "vcan" || link.kind == "vxcan";
    status_.knows_errors = !link.controller() || link.reports_errors;
    if (link.counts) {
      status_.knows_counters = true;
      status_.tec = link.tec;
      status_.rec = link.rec;
    }
    if (link.state == CanState::passive && !status_.error_passive()) status_.tec = 128;
    if (link.state == CanState::active && status_.error_passive()) status_.tec = status_.rec = 0;
    if (before.up && !status_.up) drop_queue();
    if (status_.up) trouble_.clear();
    if (look_needed() && !look_.timed()) look_.arm(look_again);
    if (before.up != status_.up || before.bus_off != status_.bus_off || before.bit_rate != status_.bit_rate ||
        before.listen_only != status_.listen_only || level != level_of(status_)) {
      tell_changed();
    }
  }

  // A virtual interface's bus-off is another program's error frame, and its rate a word.
  void learn_label() {
    status_.bus_off = false;
    status_.tec = status_.rec = 0;
    status_.bit_rate = wanted_.bit_rate;
    tell_changed();
  }

  void goes_down() noexcept {
    drop_queue();
    ask();
    look_.arm(look_again);
    if (!status_.up) return;
    status_.up = false;
    trouble_ = name_ + " went down; " + ip_command(down(link_), wanted_);
    tell_changed();
  }
  static Link down(Link link) {
    link.up = false;
    return link;
  }

  void vanishes() {
    if (!there_ && !status_.up) return;
    read_all();  // what came before
    unbind();
    drop_queue();
    trouble_ = name_ + ": there is no such interface any more";
    if (!std::exchange(status_.up, false)) return;
    tell_changed();
  }

  // An answer that was on its way when something newer was heard is not believed.
  void ask() noexcept { links_.ask(++sequence_, name_); }

  void hear_links() noexcept {
    bool news = false;
    for (int packets = 0; packets < 16; ++packets) {
      const auto heard = links_.receive();
      if (!heard) break;
      news = news || heard->overrun;
      for (const auto& notice : heard->notices) {
        if (notice.sequence == sequence_) {
          answer(notice);
        } else if (notice.link.name == name_ || notice.link.index == link_.index) {
          news = true;
        }
      }
    }
    if (news) ask();
  }

  void answer(const LinkNotice& notice) {
    if (notice.kind == LinkNotice::Kind::reply && notice.error != 0) return vanishes();
    if (notice.kind != LinkNotice::Kind::link || notice.link.name != name_) return;
    if (there_ && notice.link.index != link_.index) vanishes();  // and another of the same name is there
    if (!there_ && !come_back(notice.link)) return;
    learn(notice.link);
  }

  bool come_back(const Link& link) {
    if (!link.can) return false;
    link_ = link;
    if (bind()) return true;
    trouble_ = name_ + ": " + std::strerror(errno);
    return false;
  }

  // A virtual interface that is up has nothing to be looked at, and a timer would cost each wait for frames.
  void look() noexcept {
    if (!look_needed()) return;
    look_.arm(look_again);
    ask();
  }
  [[nodiscard]] bool look_needed() const noexcept { return link_.controller() || !status_.up; }

  bool out_of_bus_off() {
    if (link_.restart_ms != 0) return true;  // the kernel does it by itself, and no other may
    const auto done = apply(link_.index, {.restart = true});
    if (!done) {
      trouble_ = name_ + ": the controller is bus-off and cannot be started again: " + done.error().text +
                 (done.error().not_allowed() ? "; as root: ip link set " + name_ + " type can restart" : "");
      return false;
    }
    const auto now = read_link(name_);
    if (!now) return false;
    learn(*now);
    status_.tec = status_.rec = 0;
    ask();
    return true;
  }

  // After this port set the interface up, or tried to: that it went down in between is not told.
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
    ask();
    return now && status_.up;
  }

  // ---- out ----

  can::Queued keep(const can::Frame& frame, std::uint32_t tag) noexcept {
    if (waiting_.size() >= queue_depth) return can::Queued::full;
    waiting_.push_back({frame, tag, 0});
    return can::Queued::yes;
  }

  // Only what passes the filter comes back.
  void note_written(const can::Frame& frame, std::uint32_t tag) noexcept {
    if (!hears_own_ || !can::contains(installed_, frame.key())) return;
    if (written_.size() >= most_unconfirmed) written_.pop_front();
    written_.push_back({frame, tag, 0});
  }

  void try_later() noexcept {
    const auto rate = status_.bit_rate_is_label ? 0 : status_.bit_rate;
    const auto frame_time = rate == 0 ? rt::Duration(1ms) : rt::Duration(130'000'000'000LL / rate);
    retry_.arm(std::max<rt::Duration>(frame_time, 250us));
  }

  void try_when_writable(bool on) noexcept {
    if (watches_out_ == on) return;
    watches_out_ = loop_->watch(socket_.fd(), *this, on ? EPOLLIN | EPOLLOUT : EPOLLIN) && on;
    if (on && !watches_out_) try_later();
  }

  void flush() noexcept {
    stuck_ = true;  // unless all is written
    while (!waiting_.empty() && status_.up && !status_.bus_off) {
      KernelFrame bytes;
      const std::size_t size = encode_frame(waiting_.front().frame, bytes);
      switch (socket_.write(bytes, size)) {
        case CanSocket::Wrote::yes: note_written(waiting_.front().frame, waiting_.front().tag); break;
        case CanSocket::Wrote::full: return try_later();
        case CanSocket::Wrote::waiting: return try_when_writable(true);
        case CanSocket::Wrote::down: return goes_down();
        case CanSocket::Wrote::refused: break;
      }
      waiting_.pop_front();
    }
    stuck_ = false;
    try_when_writable(false);
  }

  void drop_queue() noexcept {
    waiting_.clear();
    written_.clear();
    stuck_ = false;
    retry_.cancel();
    write_.cancel();
    if (there_) try_when_writable(false);
  }

  // ---- in ----

  void ready(std::uint32_t events) noexcept override {
    freed_ = false;
    read_all();
    if ((events & EPOLLOUT) != 0 || (freed_ && !waiting_.empty())) flush();
  }

  void read_all() noexcept {
    for (unsigned i = 0; i < most_batches && deliveries_.size() < most_events; ++i) {
      const std::size_t room = std::min(at_a_time_, most_events - deliveries_.size());
      int error = 0;
      const auto got = socket_.read(room, error);
      // It was there when the last batch was read.
      const bool backlog = !got.empty() && got.front().stamp && *got.front().stamp < stamps_.wall();
      if (!got.empty() && !stamps_.begin_as_before(loop_->woke(), got.back().stamp)) {
        stamps_.begin(loop_->clock(), wall_clock());
      }
      for (const auto& r : got) arrived(r);
      if (error != 0) goes_down();
      // One by one while they come one by one: asking for more than there is costs the kernel a look in vain.
      at_a_time_ = backlog ? std::min(at_a_time_ * 2, CanSocket::batch) : got.size() < room ? 1 : at_a_time_;
      if (error == 0 && (got.size() < room || room == 1)) break;
    }
  }

  // Strictly before this instant: a comparison shows that a frame was heard later than it was on the wire.
  void arrived(const CanSocket::Received& r) noexcept {
    const rt::Time at = stamps_.at(r.stamp, executor_->now() - rt::Duration{1});
    if (const auto frame = decode_frame(r.bytes)) {
      if (r.own) {
        echoed(*frame, at);
      } else {
        count_unwanted(*frame);
        deliveries_.received(*frame, at);
      }
    } else if (const auto report = decode_error(r.bytes)) {
      heard_error(*report, at);
    }
  }

  // Frames go out in the order of writing. One that is passed over has its echo among what the receive buffer lost, and
  // then it was sent before this one; else the controller sends by priority, or the driver dropped it.
  void echoed(const can::Frame& frame, rt::Time at) noexcept {
    freed_ = true;
    const auto it = std::ranges::find_if(written_, [&frame](const Given& g) { return g.frame == frame; });
    if (it == written_.end()) return;
    const bool lost_some = socket_.dropped() != dropped_when_echoed_;
    dropped_when_echoed_ = socket_.dropped();
    const auto first = lost_some ? written_.begin() : it;
    for (auto g = written_.begin(); g != first; ++g) ++g->passed;
    for (auto g = first; g <= it; ++g) {
      if (g->tag != 0) deliveries_.sent(g->tag, at);
    }
    written_.erase(first, it + 1);
    while (!written_.empty() && written_.front().passed >= most_passed) written_.pop_front();
  }

  void heard_error(const BusReport& report, rt::Time at) noexcept {
    const can::Status before = status_;
    const Level level = level_of(status_);
    if (report.error) ++status_.errors;
    if (report.overflow) ++overflows_;
    if (report.counts) status_.knows_counters = true;
    if (report.counts || report.level) {
      status_.tec = report.tec;
      status_.rec = report.rec;
    }
    if (report.restarted) {
      status_.bus_off = false;
      status_.tec = status_.rec = 0;
    }
    if (report.bus_off) {
      status_.bus_off = true;
      drop_queue();
    }
    if (report.restarted || report.bus_off) ask();
    if (before.bus_off != status_.bus_off || level != level_of(status_)) tell_changed(at);
  }

  // ---- acceptance ----

  // A user that never asks when a frame was sent is spared the reading of it.
  void expect_echo(std::uint32_t key) noexcept {
    if (!hears_own_ && there_) hears_own_ = socket_.hear_own();
    if (can::contains(installed_, key)) return;
    if (echoed_.size() >= most_echoed) {
      echoed_ = {can::all_base, can::all_extended};
    } else {
      echoed_.push_back(can::only(key));
    }
    install();
  }

  void install() noexcept {
    auto all = echoed_;
    all.insert(all.end(), deliveries_.accept().begin(), deliveries_.accept().end());
    installed_ = can::normalised(all);
    unwanted_ = 0;
    if (!there_ || socket_.filter(kernel_filters(installed_, most_filters))) return;
    const KernelFilter everything;
    socket_.filter({&everything, 1});
  }

  // What passed the kernel's filter in vain.
  void count_unwanted(const can::Frame& frame) noexcept {
    if (!can::contains(deliveries_.accept(), frame.key()) && ++unwanted_ >= much_unwanted) install();
  }

  // ---- to the listener ----

  void tell_changed() noexcept { tell_changed(stamps_.not_before(executor_->now() - rt::Duration{1})); }
  void tell_changed(rt::Time at) noexcept {
    if (deliveries_.anybody()) deliveries_.changed(status(), at);
  }

  Loop* loop_;
  rt::Executor* executor_;
  std::string name_;
  Wanted wanted_;
  Link link_;
  bool there_ = false;  // bound to an interface that exists, up or not
  std::optional<Link> put_back_{};
  CanSocket socket_;
  LinkWatch links_;
  LinksEar links_ear_;
  std::uint32_t sequence_ = first_sequence;
  can::Status status_;
  std::uint32_t overflows_ = 0;    // of the controller
  std::uint32_t lost_before_ = 0;  // of earlier sockets
  rt::Time counted_{};
  std::string trouble_;
  StampMap stamps_;
  std::size_t at_a_time_ = 1;            // frames asked for
  std::vector<can::IdRange> echoed_;     // what is or was sent with a tag
  std::vector<can::IdRange> installed_;  // what passes the kernel's filter
  std::uint32_t unwanted_ = 0;
  std::deque<Given> waiting_;  // the kernel has not taken them
  std::deque<Given> written_;  // echo awaited, oldest first
  std::uint32_t dropped_when_echoed_ = 0;
  bool hears_own_ = false;
  bool stuck_ = false;  // the kernel takes nothing now
  bool watches_out_ = false;
  bool freed_ = false;  // the kernel's queue has become shorter
  Deliveries deliveries_{*executor_};
  rt::Later<Impl, &Impl::flush> write_{*this, *executor_};
  rt::Later<Impl, &Impl::flush> retry_{*this, *executor_};
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
  if (changes_for_listening(*found, steps, wanted)) impl->was(*found);
  if (!impl->start(*link)) return tl::unexpected(no_socket(interface));
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
