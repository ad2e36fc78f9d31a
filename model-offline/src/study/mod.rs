//! Studies of the methods themselves: which is fast, which is accurate, and where each stops working.
