#include "berth/analysis/response.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/can/length.hpp"

namespace berth::analysis {
namespace {

using Ns = std::int64_t;

constexpr Ns no_bound = -1;
constexpr unsigned error_bits = 31;  // error flags, delimiter, intermission, and the pause of an error-passive node

constexpr Ns ceil_div(Ns a, Ns b) noexcept { return a <= 0 ? 0 : (a + b - 1) / b; }

// One message, in numbers.
struct Task {
  std::uint32_t key;
  std::size_t sender;
  Ns c;                  // length of the frame
  Ns t;                  // period; 0: it may come at any time
  Ns j;                  // jitter
  Ns f = 0;              // longest wait in a FIFO before the frame takes part in arbitration
  bool endless = false;  // that wait has no bound
  bool never = false;    // the message that triggers it has no bound
  Ns queued{};           // bound from entering the queue to the end of the frame
  Ns worst{};            // bound from the event to the end of the frame
  Ns chain = 0;          // bound for this frame and those that it waits for, together
};

/// The frames that are sent in one order, those of a FIFO or of one message, and what can be sent before them. The
/// results stay: if other messages wait longer, the search continues from them, because no bound becomes shorter.
struct Order {
  std::vector<std::size_t> own = {};
  std::vector<std::size_t> before = {};  // other messages, which win arbitration against the lowest of `own`
  Ns blocking = 0;
  Ns resent = 0;  // the longest frame that an error can destroy
  Ns busy = 0;    // the longest time without a pause in which the bus has work of this priority
  struct Instant {
    Ns at;         // one more frame can be queued at this time
    Ns own_work;   // length of all frames that can be queued from the beginning up to `at`
    Ns start = 0;  // latest start of the last of them, whose length is the first of the pair
  };
  /// Ascending, within `busy`, for each length of a frame in `own`.
  std::vector<std::pair<Ns, std::vector<Instant>>> instants = {};
};

class Analyzer {
 public:
  explicit Analyzer(const Line& line) : line_(line), bit_(ceil_div(1'000'000'000, line.bit_rate)) {
    for (const Message& m : line.messages) {
      const bool extended = (m.key & can::extended_flag) != 0;
      tasks_.push_back({.key = m.key,
                        .sender = m.sender,
                        .c = frame_time(line, extended, m.data_bytes).count(),
                        .t = m.period.count(),
                        .j = m.jitter.count()});
      longest_ = std::max(longest_, 100 * (m.period + m.jitter).count());
    }
  }

  // Waiting in a FIFO delays other messages, which then wait longer. This iterates from below to the least consistent
  // solution. A message that is in no FIFO delays others by its frame only, so it is bounded once, after that. FIFOs
  // that delay each other without end are given up sooner: a wait of ten of the longest periods counts as no bound.
  void run() {
    fifos_ = all_fifos();
    find_senders();
    const Ns longest = longest_;
    if (fifos_.size() > 1) longest_ /= 10;
    for (bool again = true; again;) {
      again = false;
      for (Order& fifo : fifos_) {
        bound(fifo);
        for (const std::size_t i : fifo.own) again = waits_longer(tasks_[i]) || again;
      }
      for (const std::size_t i : cause_) again = lets_go(i) || again;
    }
    longest_ = longest;
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      const Queue queue = line_.senders[tasks_[i].sender].queue;
      if (queue == Queue::in_order) {
        find_chain(i, fifo_of(i));
        continue;
      }
      const Task fifo = tasks_[i];
      Order alone = order_of({i});
      bound(alone);
      if (queue == Queue::unknown) take_worse(tasks_[i], fifo);
      find_chain(i, alone);
      if (queue == Queue::unknown) find_chain(i, fifo_of(i));
    }
  }
  [[nodiscard]] const std::vector<Task>& tasks() const noexcept { return tasks_; }

 private:
  // The messages whose reception triggers others.
  void find_senders() {
    std::vector<std::uint32_t> keys;
    for (const Message& m : line_.messages) {
      if (m.after && std::ranges::find(keys, *m.after) == keys.end()) keys.push_back(*m.after);
    }
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      if (std::ranges::find(keys, tasks_[i].key) != keys.end()) cause_.push_back(i);
    }
  }

  // The response time of this message is jitter of the messages that it triggers. True: that jitter has grown.
  bool lets_go(std::size_t cause) {
    const Queue queue = line_.senders[tasks_[cause].sender].queue;
    Task& task = tasks_[cause];
    const Task fifo = task;
    if (queue != Queue::in_order) {
      Order alone = order_of({cause});
      bound(alone);
      if (queue == Queue::unknown) take_worse(task, fifo);
    }
    const Ns worst = task.worst;
    if (queue == Queue::unknown) task = fifo;
    bool more = false;
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      if (line_.messages[i].after != task.key) continue;
      const Ns jitter = line_.messages[i].jitter.count() + (worst == no_bound ? 0 : worst);
      if (worst == no_bound ? tasks_[i].never : jitter <= tasks_[i].j) continue;
      tasks_[i].never = tasks_[i].never || worst == no_bound;
      tasks_[i].j = std::max(tasks_[i].j, jitter);
      more = true;
      for (Order& each : fifos_) {
        if (std::ranges::count(each.own, i) > 0) each.instants.clear();
      }
    }
    return more;
  }

  // An unknown queue counts as a FIFO here, which is worse for the other senders.
  [[nodiscard]] bool in_order(const Task& task) const noexcept {
    return line_.senders[task.sender].queue != Queue::priority;
  }

  static bool waits_longer(Task& task) noexcept {
    const bool endless = task.queued == no_bound;
    const Ns f = endless ? task.f : task.queued - task.c;
    const bool longer = f > task.f || endless != task.endless;
    task.f = std::max(task.f, f);
    task.endless = task.endless || endless;
    return longer;
  }

  // For the messages of the queue itself, either order may be the worse one.
  static void take_worse(Task& task, const Task& other) noexcept {
    const bool bounded = task.worst != no_bound && other.worst != no_bound;
    task.queued = bounded ? std::max(task.queued, other.queued) : no_bound;
    task.worst = bounded ? std::max(task.worst, other.worst) : no_bound;
  }

  [[nodiscard]] std::vector<Order> all_fifos() const {
    std::vector<Order> fifos;
    for (std::size_t sender = 0; sender < line_.senders.size(); ++sender) {
      std::vector<std::size_t> own;
      for (std::size_t i = 0; i < tasks_.size(); ++i) {
        if (tasks_[i].sender == sender && in_order(tasks_[i])) own.push_back(i);
      }
      if (!own.empty()) fifos.push_back(order_of(std::move(own)));
    }
    return fifos;
  }

  [[nodiscard]] Order order_of(std::vector<std::size_t> own) const {
    Order order{.own = std::move(own)};
    std::uint32_t lowest = tasks_[order.own.front()].key;
    for (const std::size_t i : order.own) {
      if (precedes(lowest, tasks_[i].key)) lowest = tasks_[i].key;
    }
    if (line_.background_bytes)
      order.blocking = frame_time(line_, line_.background_extended, *line_.background_bytes).count();
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      const Task& each = tasks_[i];
      if (std::ranges::find(order.own, i) != order.own.end()) {
        order.resent = std::max(order.resent, each.c);
      } else if (precedes(each.key, lowest) || each.key == lowest) {
        order.before.push_back(i);
        order.resent = std::max(order.resent, each.c);
      } else {
        order.blocking = std::max(order.blocking, each.c);
      }
    }
    return order;
  }

  // One of them may come at any time, or its wait before it comes has no bound.
  [[nodiscard]] bool endless(const Order& order) const {
    const auto of_another = [&](const Task& each) { return each.sender != tasks_[order.own.front()].sender; };
    return std::ranges::any_of(order.own, [&](std::size_t i) { return tasks_[i].t == 0 || tasks_[i].never; }) ||
           std::ranges::any_of(order.before, [&](std::size_t i) {
             return tasks_[i].t == 0 || tasks_[i].never || (tasks_[i].endless && of_another(tasks_[i]));
           });
  }

  /// The messages before an order. Their numbers lie side by side because they are added up again and again.
  struct Load {
    Ns c;
    Ns t;
    Ns late;  // jitter, and the wait in a FIFO
  };
  [[nodiscard]] std::vector<Load> loads_before(const Order& order) const {
    std::vector<Load> loads;
    loads.reserve(order.before.size());
    const std::size_t sender = tasks_[order.own.front()].sender;
    for (const std::size_t i : order.before) {
      const Task& each = tasks_[i];
      // The sender's own messages are sent in one order with this one: their wait in the queue does not count.
      loads.push_back({each.c, each.t, each.j + (each.sender == sender ? 0 : each.f)});
    }
    return loads;
  }

  [[nodiscard]] static Ns work_of(Ns time, const std::vector<Load>& loads) noexcept {
    Ns sum = 0;
    for (const Load& each : loads) sum += ceil_div(time + each.late, each.t) * each.c;
    return sum;
  }

  [[nodiscard]] Ns errors_in(Ns time, const Order& order) const noexcept {
    const Ns interval = line_.errors.interval.count();
    if (interval <= 0) return 0;
    const Ns burst = std::max(1U, line_.errors.burst);
    return (burst - 1 + ceil_div(time, interval)) * (error_bits * bit_ + order.resent);
  }

  // The work of the order's frames that can be queued up to and at `x`, in a window that begins with all of them.
  [[nodiscard]] Ns own_until(Ns x, const Order& order) const noexcept {
    Ns sum = 0;
    for (const std::size_t i : order.own) sum += ((x + tasks_[i].j) / tasks_[i].t + 1) * tasks_[i].c;
    return sum;
  }

  [[nodiscard]] double load_of(const std::vector<std::size_t>& tasks) const noexcept {
    double sum = 0;
    for (const std::size_t i : tasks) sum += static_cast<double>(tasks_[i].c) / static_cast<double>(tasks_[i].t);
    return sum;
  }

  // False: the busy period never ends.
  [[nodiscard]] bool find_busy(Order& order, const std::vector<Load>& before) const noexcept {
    if (load_of(order.own) + load_of(order.before) > 1) return false;
    for (Ns length = std::max(order.busy, order.blocking + 1); length <= longest_;) {
      Ns next = order.blocking + work_of(length, before) + errors_in(length, order);
      for (const std::size_t i : order.own) next += ceil_div(length + tasks_[i].j, tasks_[i].t) * tasks_[i].c;
      order.busy = length;
      if (next <= length) return true;
      length = next;
    }
    return false;
  }

  // Finds when the last frame that was queued up to the instant starts, from the beginning of the window. `last` is the
  // length of that frame.
  [[nodiscard]] bool find_start(Order::Instant& instant, Ns last, const Order& order,
                                const std::vector<Load>& before) const noexcept {
    const Ns least = order.blocking + instant.own_work - last;
    for (Ns start = std::max(instant.start, least); start <= longest_;) {
      const Ns next = least + work_of(start + bit_, before) + errors_in(start + last, order);
      instant.start = start;
      if (next <= start) return true;
      start = next;
    }
    return false;
  }

  // The instants at which one more frame can be queued, ascending. Known instants stay.
  void find_instants(Order& order) const {
    std::vector<Ns> all{0};
    for (const std::size_t i : order.own) {
      const Task& own = tasks_[i];
      for (Ns n = own.j / own.t + 1; n * own.t - own.j < order.busy; ++n) all.push_back(n * own.t - own.j);
    }
    std::ranges::sort(all);
    const auto [first, end] = std::ranges::unique(all);
    all.erase(first, end);
    for (const std::size_t i : order.own) {
      const auto same = std::ranges::find(order.instants, tasks_[i].c, &decltype(order.instants)::value_type::first);
      if (same == order.instants.end()) order.instants.push_back({tasks_[i].c, {}});
    }
    for (auto& [length, known] : order.instants) {
      for (std::size_t n = known.size(); n < all.size(); ++n) known.push_back({all[n], own_until(all[n], order)});
    }
  }

  void bound(Order& order) {
    for (const std::size_t i : order.own) tasks_[i].queued = tasks_[i].worst = no_bound;
    if (endless(order)) return;
    const auto before = loads_before(order);
    if (!find_busy(order, before)) return;
    find_instants(order);
    for (auto& [length, instants] : order.instants) {
      for (auto& instant : instants) {
        if (!find_start(instant, length, order, before)) return;
      }
    }
    for (const std::size_t i : order.own) {
      const auto& instants =
          std::ranges::find(order.instants, tasks_[i].c, &decltype(order.instants)::value_type::first)->second;
      take(tasks_[i], instants);
    }
  }

  [[nodiscard]] const Order& fifo_of(std::size_t i) const {
    return *std::ranges::find_if(fifos_, [i](const Order& each) { return std::ranges::count(each.own, i) > 0; });
  }

  // The message together with those of its frames whose ends it waits for. The longest result of all orders in which it
  // may be sent counts.
  void find_chain(std::size_t i, const Order& order) {
    Task& task = tasks_[i];
    const unsigned before = line_.messages[i].frames_before;
    if (before == 0 || task.worst == no_bound) return;
    task.chain = std::max(task.chain, chain_of(i, order, (before + 1) * task.worst));
  }

  // The frames count together: a message that comes once in their whole time delays only one of them. `most`: each
  // frame is as late as possible.
  [[nodiscard]] Ns chain_of(std::size_t i, const Order& order, Ns most) const noexcept {
    const Message& message = line_.messages[i];
    const Ns frames = message.frames_before + 1;
    const Ns pauses = message.before.count() + frames * bit_;
    const bool alone = order.own.size() == 1;
    const auto before = loads_before(order);
    // The frame before the first one may have begun already. When it began, nothing with higher priority waited.
    const Ns blocking = (frames - 1) * order.blocking + std::max(order.blocking, tasks_[i].c);
    for (Ns length = frames * tasks_[i].c; length <= most;) {
      const Ns window = length + pauses;
      Ns next = blocking + work_of(window, before) + errors_in(window, order);
      next += alone ? frames * tasks_[i].c : own_until(window, order);
      if (next <= length) return length;
      length = next;
    }
    return most;
  }

  static void take(Task& task, const std::vector<Order::Instant>& instants) noexcept {
    task.queued = task.worst = 0;
    for (const auto& [x, work, start] : instants) {
      // The event of the frame that is queued at x was before x, at most by the jitter, and a period after the previous
      // event. If the jitter is a period or more, frames may have overtaken each other.
      const Ns in_order = std::max((x + task.j) / task.t * task.t, x) - task.j;
      const Ns event = task.j >= task.t ? x - task.j : in_order;
      task.queued = std::max(task.queued, start + task.c - x);
      task.worst = std::max(task.worst, start + task.c - event);
    }
  }

  const Line& line_;
  Ns bit_;
  Ns longest_ = 0;
  std::vector<Task> tasks_;
  std::vector<Order> fifos_;
  std::vector<std::size_t> cause_;  // messages whose reception triggers others
};

/// From the cause to its effect.
std::optional<rt::Duration> arrival_of(const Message& message, const Response& response,
                                       const std::vector<Task>& tasks) {
  if (!response.worst) return std::nullopt;
  const Ns chain = tasks[response.message].chain;
  if (message.counts_every <= rt::Duration(0)) return message.before + std::max(*response.worst, rt::Duration(chain));
  const Ns every = message.counts_every.count();
  Ns act = 0;
  for (const Task& task : tasks) {
    if (task.key == message.after) act = std::max(act, task.worst);
  }
  return message.before + rt::Duration(ceil_div(response.worst->count(), every) * every + act);
}

}  // namespace

std::string key_text(std::uint32_t key) {
  const bool extended = (key & can::extended_flag) != 0;
  return extended ? fmt::format("{:08X}h", key & ~can::extended_flag) : fmt::format("{:03X}h", key);
}

bool Result::good() const noexcept {
  return load <= 1 && std::ranges::all_of(responses, [](const Response& r) { return r.worst && r.meets_deadline; });
}

std::string wrong(const Line& line) {
  if (line.bit_rate == 0) return "the bus has no bit rate";
  if (line.background_bytes.value_or(0) > 8) return "a frame has 8 bytes of data at most";
  if (line.errors.interval.count() < 0) return "the time between errors is negative";
  for (const Message& m : line.messages) {
    const char* why = nullptr;
    if (m.sender >= line.senders.size()) why = "its sender is not there";
    if (m.data_bytes > 8) why = "a frame has 8 bytes of data at most";
    const auto least = std::min({m.period, m.jitter, m.deadline, m.before, m.counts_every});
    if (least.count() < 0) why = "a time is negative";
    if (why != nullptr) return fmt::format("{}: {}", m.name, why);
  }
  return {};
}

Result analyze(const Line& line) {
  Analyzer analyzer(line);
  analyzer.run();
  Result result;
  for (std::size_t i = 0; i < line.messages.size(); ++i) {
    const Task& task = analyzer.tasks()[i];
    Response r{.message = i, .frame = rt::Duration(task.c)};
    if (task.t > 0) r.load = static_cast<double>(task.c) / static_cast<double>(task.t);
    if (task.worst != no_bound) r.worst = rt::Duration(task.worst);
    const rt::Duration deadline = line.messages[i].deadline;
    r.arrival = arrival_of(line.messages[i], r, analyzer.tasks());
    r.meets_deadline = r.arrival && (deadline.count() == 0 || *r.arrival <= deadline);
    result.load += r.load;
    result.responses.push_back(r);
  }
  return result;
}

rt::Duration frame_time(const Line& line, bool extended, unsigned data_bytes) noexcept {
  const bool usual = line.lengths == FrameLengths::usual;
  const Ns bits = usual ? can::worst_case_bits(extended, data_bytes) : can::reachable_most_bits(extended, data_bytes);
  return rt::Duration(ceil_div(bits * 1'000'000'000, line.bit_rate));
}

bool precedes(std::uint32_t a, std::uint32_t b) noexcept {
  const auto base = [](std::uint32_t key) {
    const bool extended = (key & can::extended_flag) != 0;
    return extended ? (key & ~can::extended_flag) >> 18U : key;
  };
  const bool a_extended = (a & can::extended_flag) != 0;
  const bool b_extended = (b & can::extended_flag) != 0;
  if (base(a) != base(b)) return base(a) < base(b);
  if (a_extended != b_extended) return b_extended;
  return a < b;
}

}  // namespace berth::analysis
