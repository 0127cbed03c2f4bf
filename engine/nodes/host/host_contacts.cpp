#include "nodes/host/host_contacts.hpp"

#include <algorithm>
#include <utility>

#include "base/number_index.hpp"
#include "base/pair_sort.hpp"

namespace ringfence::nodes {

void HostContacts::add(std::uint64_t frame, const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    add(frame, message.record<Contact>(i));
  }
}

void HostContacts::add_late(const messages::MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    add_late(message.record<Contact>(i));
  }
}

void HostContacts::ContactList::add(const Contact& contact) {
  contacts.push_back(contact);
  keys.push_back(contact.phase == Phase::end ? 0 : base::PairSort::key(contact.a, contact.b));
}

// An unlisted contact keeps its place among the contacts, where others are known by their positions. For gather() it is
// marked as ended.
void HostContacts::ContactList::unlist(std::span<const std::uint64_t> listed) noexcept {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < own_order.size(); ++i) {
    if (kept < listed.size() && keys[i] == listed[kept]) {
      keys[kept] = keys[i];
      own_order[kept++] = own_order[i];
    } else {
      contacts[own_order[i].contact].phase = Phase::end;
    }
  }
  keys.resize(kept);
  own_order.resize(kept);
}

void HostContacts::ContactList::clear() noexcept {
  contacts.clear();
  keys.clear();
  own_order.clear();
  own = 0;
}

Contact& HostContacts::add_own(std::uint64_t frame) {
  ContactList& list = edition(frame);
  ++list.own;
  Contact& contact = list.contacts.add();
  // These lines were last read when the objects moved, so they are not in the cache.
  constexpr std::ptrdiff_t lines_ahead = 1024;
  base::prefetch_for_write(reinterpret_cast<const std::byte*>(&contact) + lines_ahead);
  base::prefetch_for_write(reinterpret_cast<const std::byte*>(&contact) + lines_ahead + 64);
  contact.phase = Phase::persist;  // true of 95 %; confirm_begin() corrects the others
  return contact;
}

void HostContacts::reserve(std::size_t contacts) {
  for (std::size_t frame = 0; frame < (keeps_two_ ? 2 : 1); ++frame) {
    ContactList& list = edition(frame);
    list.contacts.reserve(contacts);
    list.keys.reserve(contacts);
    list.own_order.reserve(contacts);
  }
  hosted_.reserve(contacts);
  order_.reserve(2 * contacts);
}

// Adds the late contacts to those of the frame. They are rare (the host of an object has changed at the cut), so all
// contacts are simply sorted again.
HostContacts::KnownContacts HostContacts::gather(std::uint64_t frame) {
  if (!given_.contacts.empty()) {
    return std::exchange(given_, {});
  }
  const ContactList& known = edition(frame - 1);
  if (late_.contacts.empty()) {
    return {known.contacts.span(), known.keys.span(), known.own_order.span()};
  }
  auto& all = late_.contacts;
  for (const Contact& contact : known.contacts) {
    all.push_back(contact);
  }
  const auto key = [](const Contact& contact) { return base::PairSort::key(contact.a, contact.b); };
  std::sort(all.begin(), all.end(), [&](const Contact& p, const Contact& q) { return key(p) < key(q); });
  const auto same = [&](const Contact& p, const Contact& q) { return key(p) == key(q); };
  all.resize(static_cast<std::size_t>(std::unique(all.begin(), all.end(), same) - all.begin()));
  late_.keys.clear();
  for (const Contact& contact : all) {
    late_.keys.push_back(contact.phase == Phase::end ? 0 : key(contact));
  }
  return {late_.contacts.span(), late_.keys.span(), {}};
}

// Merges own and received contacts in order of (a, b), and drops those without a hosted object. Most are own contacts,
// so an inner loop handles the own contacts before the next received one.
void HostContacts::find_hosted(const KnownContacts& known, const HostedObjects& objects) {
  const std::uint64_t* const keys = known.keys.data();
  const std::size_t own_end = known.own_order.size();
  const std::size_t end = known.keys.size();
  const std::size_t unlisted = known.contacts.size() - end;  // own contacts without a key
  hosted_.resize(end);
  HostedContact* out = hosted_.data();
  const auto add = [&](std::uint64_t key, const HostedContact& was) {
    const std::uint32_t a = objects.find(static_cast<ObjectNumber>(key >> 32), was.a);
    const std::uint32_t b = objects.find(static_cast<ObjectNumber>(key), was.b);
    *out = {was.contact, a, b};
    out += (a & b) != base::NumberIndex::none ? 1 : 0;
  };
  const auto prefetch = [&](std::size_t i, const HostedContact& was) {
    objects.prefetch_number(static_cast<ObjectNumber>(keys[i] >> 32), was.a);
    objects.prefetch_number(static_cast<ObjectNumber>(keys[i]), was.b);
  };
  constexpr HostedContact nothing_known{0, base::NumberIndex::none, base::NumberIndex::none};
  constexpr std::size_t ahead = 16;
  // Between two received contacts there are usually many own ones, if any.
  const std::size_t received_ahead = own_end == 0 ? ahead : 4;
  std::size_t own = 0;
  for (std::size_t received = own_end; received <= end; ++received) {
    if (received + received_ahead < end) {
      prefetch(received + received_ahead, nothing_known);
    }
    if (received < end && keys[received] == 0) {
      continue;  // an ended contact
    }
    const std::uint64_t until = received < end ? keys[received] : ~std::uint64_t{0};
    for (; own < own_end && keys[own] < until; ++own) {
      if (own + ahead < own_end) {
        prefetch(own + ahead, known.own_order[own + ahead]);
      }
      add(keys[own], known.own_order[own]);
    }
    if (received < end) {
      const auto at = static_cast<std::uint32_t>(received + unlisted);
      add(keys[received], {at, base::NumberIndex::none, base::NumberIndex::none});
    }
  }
  hosted_.resize(static_cast<std::size_t>(out - hosted_.data()));
}

// Stable counting sort of the contacts by hosted object; the contacts of one object stay in order of (a, b). Objects
// that are not hosted are counted in an extra first entry: none + 1 is 0.
void HostContacts::begin_move(std::uint64_t frame, const HostedObjects& objects) {
  static_assert(base::NumberIndex::none + 1 == 0);
  const std::size_t count = objects.size();
  const KnownContacts known = gather(frame);
  find_hosted(known, objects);
  begins_.assign(count + 2, 0);
  std::uint32_t* const next = begins_.data() + 1;
  for (const HostedContact& hosted : hosted_) {
    ++next[hosted.a + 1];
    ++next[hosted.b + 1];
  }
  next[0] = 0;
  for (std::size_t i = 0; i < count; ++i) {
    next[i + 1] += next[i];
  }
  order_.resize(next[count]);
  // Each put() advances the begin of an object, in the end to the begin of the next object. So each begin was stored
  // one entry too far.
  const auto put = [&](std::uint32_t i, std::uint32_t contact) {
    if (i != base::NumberIndex::none) {
      order_[next[i]++] = contact;
    }
  };
  for (const HostedContact& hosted : hosted_) {
    put(hosted.a, hosted.contact);
    put(hosted.b, hosted.contact);
  }
  list_ = known.contacts.data();
}

}  // namespace ringfence::nodes
