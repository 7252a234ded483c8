//! Operations of a kernel turned into what a driver may make of them, expression by expression.

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    Arena, BinaryOperator, Block, Expression, Function, Handle, Literal, MathFunction, Module,
    Range, Scalar, Span, Statement, TypeInner, UnaryOperator,
};

use super::Edit;

/// Built-in functions that no kernel calls, which stand for the functions of `driver.wgsl` until the
/// module is text; roots are calls already.
pub(super) const MARKERS: [(&str, &str); 4] = [
    ("atan2", "driver_quotient"),
    ("distance", "driver_product"),
    ("mix", "driver_contracted"),
    ("sqrt", "driver_root"),
];

/// Applies `edits` to every function of `module`.
pub(super) fn rewrite(module: &mut Module, info: &ModuleInfo, edits: &[Edit]) {
    let handles: Vec<_> = module.functions.iter().map(|(handle, _)| handle).collect();
    for handle in handles {
        let numbers = numbers(&module.functions[handle], &info[handle], module);
        Rewriting::new(numbers, edits).apply(module.functions.get_mut(handle));
    }
    for i in 0..module.entry_points.len() {
        let function = &module.entry_points[i].function;
        let numbers = numbers(function, info.get_entry_point(i), module);
        Rewriting::new(numbers, edits).apply(&mut module.entry_points[i].function);
    }
}

/// Which expressions are a single f32.
fn numbers(function: &Function, info: &FunctionInfo, module: &Module) -> Vec<bool> {
    let number = |handle: Handle<Expression>| {
        let inner = info[handle].ty.inner_with(&module.types);
        matches!(inner, TypeInner::Scalar(scalar) if *scalar == Scalar::F32)
    };
    function.expressions.iter().map(|(handle, _)| number(handle)).collect()
}

/// A function on its way to other expressions.
struct Rewriting<'a> {
    edits: &'a [Edit],
    numbers: Vec<bool>,
    old: Arena<Expression>,
    new: Arena<Expression>,
    /// The new expression of each old one, and the first of those that it takes.
    places: Vec<[Handle<Expression>; 2]>,
    /// The first of the new expressions since the last place.
    first: Option<Handle<Expression>>,
    zero: Handle<Expression>,
    one: Handle<Expression>,
}

impl<'a> Rewriting<'a> {
    fn new(numbers: Vec<bool>, edits: &'a [Edit]) -> Self {
        let mut new = Arena::new();
        let zero = new.append(Expression::Literal(Literal::F32(0.0)), Span::UNDEFINED);
        let one = new.append(Expression::Literal(Literal::F32(1.0)), Span::UNDEFINED);
        let old = Arena::new();
        Self { edits, numbers, old, new, places: Vec::new(), first: None, zero, one }
    }

    fn apply(mut self, function: &mut Function) {
        self.old = std::mem::take(&mut function.expressions);
        let old: Vec<Expression> = self.old.iter().map(|(_, one)| one.clone()).collect();
        for (i, expression) in old.into_iter().enumerate() {
            self.first = None;
            let last = if self.numbers[i] { self.arithmetic(&expression) } else { None };
            let last = last.or_else(|| self.comparison(&expression)).unwrap_or_else(|| {
                let mut same = expression;
                operands(&mut same, |operand| self.places[operand.index()][0]);
                self.append(same)
            });
            self.places.push([last, self.first.expect("at least one was appended")]);
        }
        let named = std::mem::take(&mut function.named_expressions);
        function.named_expressions =
            named.into_iter().map(|(handle, name)| (self.at(handle), name)).collect();
        for (_, variable) in function.local_variables.iter_mut() {
            variable.init = variable.init.map(|handle| self.at(handle));
        }
        self.block(&mut function.body);
        function.expressions = self.new;
    }

    fn append(&mut self, expression: Expression) -> Handle<Expression> {
        let handle = self.new.append(expression, Span::UNDEFINED);
        self.first.get_or_insert(handle);
        handle
    }

    /// The new expression of an old one.
    fn at(&self, old: Handle<Expression>) -> Handle<Expression> {
        self.places[old.index()][0]
    }

    fn has(&self, edit: Edit) -> bool {
        self.edits.contains(&edit)
    }

    fn number(&self, old: Handle<Expression>) -> bool {
        self.numbers[old.index()]
    }

    fn binary(
        &mut self,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Handle<Expression> {
        self.append(Expression::Binary { op, left, right })
    }

    fn negated(&mut self, expr: Handle<Expression>) -> Handle<Expression> {
        self.append(Expression::Unary { op: UnaryOperator::Negate, expr })
    }

    fn marker(
        &mut self,
        fun: MathFunction,
        arguments: [Option<Handle<Expression>>; 3],
    ) -> Handle<Expression> {
        let [arg, arg1, arg2] = arguments;
        let arg = arg.expect("an argument at least");
        self.append(Expression::Math { fun, arg, arg1, arg2, arg3: None })
    }

    /// What becomes of an operation on numbers.
    fn arithmetic(&mut self, expression: &Expression) -> Option<Handle<Expression>> {
        use BinaryOperator::{Add, Divide, Multiply, Subtract};
        let cancelled = self.cancelled(expression);
        if cancelled.is_some() {
            return cancelled;
        }
        match *expression {
            Expression::Binary { op: Divide, left, right } => {
                let operands = [Some(self.at(left)), Some(self.at(right)), None];
                Some(self.marker(MathFunction::Atan2, operands))
            }
            Expression::Binary { op: Multiply, left, right } if self.has(Edit::Flush) => {
                let operands = [Some(self.at(left)), Some(self.at(right)), None];
                Some(self.marker(MathFunction::Distance, operands))
            }
            Expression::Binary { op: op @ (Add | Subtract), left, right } => {
                let contracted = self.contracted(op, left, right);
                contracted.or_else(|| self.reordered(op, left, right))
            }
            Expression::Select { condition, accept, reject } if self.has(Edit::Compare) => {
                self.largest(condition, accept, reject)
            }
            _ => None,
        }
    }

    /// What a driver knows that reckons with numbers: `a - a`, `0 a`, `0 / a` and `a / a`.
    fn cancelled(&mut self, expression: &Expression) -> Option<Handle<Expression>> {
        use BinaryOperator::{Add, Divide, Multiply, Subtract};
        let Expression::Binary { op, left, right } = *expression else { return None };
        if !self.has(Edit::Cancel) {
            return None;
        }
        let nothing = |old| match self.old[old] {
            Expression::Literal(Literal::F32(value)) => value == 0.0,
            _ => false,
        };
        let (zero, one) = (self.zero, self.one);
        match op {
            Subtract if left == right => Some(self.binary(Add, zero, zero)),
            Divide if left == right => Some(self.binary(Add, zero, one)),
            Multiply if nothing(left) || nothing(right) => Some(self.binary(Add, zero, zero)),
            Divide if nothing(left) => Some(self.binary(Add, zero, zero)),
            _ => None,
        }
    }

    /// The factors of a product of numbers.
    fn factors(&self, old: Handle<Expression>) -> Option<[Handle<Expression>; 2]> {
        match self.old[old] {
            Expression::Binary { op: BinaryOperator::Multiply, left, right }
                if self.number(left) && self.number(right) =>
            {
                Some([self.at(left), self.at(right)])
            }
            _ => None,
        }
    }

    /// A sum or difference with a product.
    fn contracted(
        &mut self,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Option<Handle<Expression>> {
        if !self.has(Edit::Contract) {
            return None;
        }
        let minus = op == BinaryOperator::Subtract;
        if let Some([a, b]) = self.factors(left) {
            let c = self.at(right);
            let c = if minus { self.negated(c) } else { c };
            return Some(self.marker(MathFunction::Mix, [Some(a), Some(b), Some(c)]));
        }
        let [a, b] = self.factors(right)?;
        let a = if minus { self.negated(a) } else { a };
        let c = self.at(left);
        Some(self.marker(MathFunction::Mix, [Some(a), Some(b), Some(c)]))
    }

    /// A sum or difference whose left side is one too: what stands last there goes first to the right.
    fn reordered(
        &mut self,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Option<Handle<Expression>> {
        use BinaryOperator::{Add, Subtract};
        if !self.has(Edit::Reorder) {
            return None;
        }
        let Expression::Binary { op: inner @ (Add | Subtract), left: a, right: b } = self.old[left]
        else {
            return None;
        };
        let (a, b, c) = (self.at(a), self.at(b), self.at(right));
        let same = if inner == op { Add } else { Subtract };
        let tail = self.binary(same, b, c);
        Some(self.binary(inner, a, tail))
    }

    /// A choice of the larger or the smaller of two numbers, which drops a NaN: the right one where the
    /// left one is none.
    fn largest(
        &mut self,
        condition: Handle<Expression>,
        accept: Handle<Expression>,
        reject: Handle<Expression>,
    ) -> Option<Handle<Expression>> {
        let Expression::Binary { op: BinaryOperator::Less, left, right } = self.old[condition]
        else {
            return None;
        };
        let pair = (left, right) == (accept, reject) || (right, left) == (accept, reject);
        if !pair {
            return None;
        }
        let fun = if accept == left { MathFunction::Min } else { MathFunction::Max };
        let operands = [Some(self.at(left)), Some(self.at(right)), None];
        Some(self.marker(fun, operands))
    }

    /// A comparison of numbers, as the opposite of its opposite.
    fn comparison(&mut self, expression: &Expression) -> Option<Handle<Expression>> {
        use BinaryOperator::{Greater, GreaterEqual, Less, LessEqual};
        let Expression::Binary { op, left, right } = *expression else { return None };
        if !self.has(Edit::Compare) || !self.number(left) {
            return None;
        }
        let opposite = match op {
            Less => GreaterEqual,
            GreaterEqual => Less,
            Greater => LessEqual,
            LessEqual => Greater,
            _ => return None,
        };
        let (left, right) = (self.at(left), self.at(right));
        let expr = self.binary(opposite, left, right);
        Some(self.append(Expression::Unary { op: UnaryOperator::LogicalNot, expr }))
    }

    fn block(&self, block: &mut Block) {
        for statement in block.iter_mut() {
            self.statement(statement);
        }
    }

    /// A statement over the new expressions.
    fn statement(&self, statement: &mut Statement) {
        let to = |handle: &mut Handle<Expression>| *handle = self.at(*handle);
        match statement {
            Statement::Emit(range) => {
                let indices = range.index_range();
                let (first, last) = (indices.start as usize, indices.end as usize - 1);
                *range = Range::new_from_bounds(self.places[first][1], self.places[last][0]);
            }
            Statement::Block(block) => self.block(block),
            Statement::If { condition, accept, reject } => {
                to(condition);
                self.block(accept);
                self.block(reject);
            }
            Statement::Switch { selector, cases } => {
                to(selector);
                cases.iter_mut().for_each(|case| self.block(&mut case.body));
            }
            Statement::Loop { body, continuing, break_if } => {
                self.block(body);
                self.block(continuing);
                break_if.iter_mut().for_each(to);
            }
            Statement::Return { value } => value.iter_mut().for_each(to),
            Statement::Store { pointer, value } => {
                to(pointer);
                to(value);
            }
            Statement::Atomic { pointer, value, result, .. } => {
                to(pointer);
                to(value);
                result.iter_mut().for_each(to);
            }
            Statement::Call { arguments, result, .. } => {
                arguments.iter_mut().for_each(to);
                result.iter_mut().for_each(to);
            }
            Statement::Break | Statement::Continue | Statement::ControlBarrier(_) => {}
            other => panic!("no kernel has the statement {other:?}"),
        }
    }
}

/// Gives `expression` the operands that `to` has for its own.
fn operands(expression: &mut Expression, to: impl Fn(Handle<Expression>) -> Handle<Expression>) {
    let to = |handle: &mut Handle<Expression>| *handle = to(*handle);
    match expression {
        Expression::Literal(_)
        | Expression::Constant(_)
        | Expression::ZeroValue(_)
        | Expression::FunctionArgument(_)
        | Expression::GlobalVariable(_)
        | Expression::LocalVariable(_)
        | Expression::CallResult(_)
        | Expression::AtomicResult { .. } => {}
        Expression::Compose { components, .. } => components.iter_mut().for_each(to),
        Expression::Access { base, index } => {
            to(base);
            to(index);
        }
        Expression::AccessIndex { base: expr, .. }
        | Expression::Splat { value: expr, .. }
        | Expression::Swizzle { vector: expr, .. }
        | Expression::Load { pointer: expr }
        | Expression::Unary { expr, .. }
        | Expression::Relational { argument: expr, .. }
        | Expression::As { expr, .. }
        | Expression::ArrayLength(expr) => to(expr),
        Expression::Binary { left, right, .. } => {
            to(left);
            to(right);
        }
        Expression::Select { condition, accept, reject } => {
            to(condition);
            to(accept);
            to(reject);
        }
        Expression::Math { arg, arg1, arg2, arg3, .. } => {
            to(arg);
            [arg1, arg2, arg3].into_iter().flatten().for_each(to);
        }
        other => panic!("no kernel has the expression {other:?}"),
    }
}
