"""A machine that runs structured text: tree-sitter's tree of a FUNCTION_BLOCK or PROGRAM becomes Python with NumPy's REALs.

Every operation on REALs gives a REAL, rounded by `numpy.float32`; a literal that is assigned or compared is what it says.
It knows what the exported block uses and refuses anything else.
"""

from types import SimpleNamespace

import numpy as np
import tree_sitter
import tree_sitter_iec61131_3_st

LANGUAGE = tree_sitter.Language(tree_sitter_iec61131_3_st.language())
ZERO = {"REAL": np.float32(0.0), "BOOL": False, "BYTE": 0, "INT": 0, "UINT": 0, "DINT": 0, "TIME": 0}
WORDS = {"AND": "and", "OR": "or", "NOT": "not ", "=": "==", "<>": "!=", "MOD": "%"}


def _divided(one, two):
    """Return a quotient: of whole numbers, none of which is negative here, the whole one."""
    return one // two if isinstance(one, int) and isinstance(two, int) else one / two


FUNCTIONS = {"ABS": abs, "UINT_TO_REAL": np.float32, "DINT_TO_REAL": np.float32, "TRUNC": int, "real": np.float32,
             "divided": _divided, "TIME_TO_REAL": lambda ms: np.float32(ms / 1000)}  # seconds, where no test says otherwise


def parse(text):
    """Return the root of the tree; the text must be without error."""
    root = tree_sitter.Parser(LANGUAGE).parse(text.encode()).root_node
    assert not root.has_error, text
    return root


def found(root, kind):
    """Return all nodes of a kind, in the order of the text."""
    here = [root] if root.type == kind else []
    return here + [each for child in root.children for each in found(child, kind)]


class FunctionBlock:
    """An instance: its variables, and `call`.

    blocks: type → what makes an instance, for those that the text declares and others' own; an instance is called with its
    inputs, and has its outputs as attributes.
    time_to_real: what that function gives of a time in ms; None: seconds.
    """

    kind = "function_block_declaration"

    def __init__(self, text, blocks=None, time_to_real=None):
        (block,) = found(parse(text), self.kind)
        self.variables = SimpleNamespace(**dict(_declared(block, blocks or {})))
        statements = block.children_by_field_name("body")
        source = "\n".join(["def run(v):", *_statements(statements, 1)])
        names = FUNCTIONS | ({"TIME_TO_REAL": time_to_real} if time_to_real else {})
        exec(compile(source, "structured text", "exec"), names)
        self._run = names["run"]

    def call(self, **inputs):
        """Set the inputs that are named, run the body, return the variables."""
        for name, value in inputs.items():
            kept = getattr(self.variables, name)
            setattr(self.variables, name, np.float32(value) if isinstance(kept, np.float32) else value)
        with np.errstate(all="ignore"):
            self._run(self.variables)
        return self.variables


class Instance:
    """A function block as a program's variable."""

    def __init__(self, text):
        self.__dict__["block"] = FunctionBlock(text)

    def __call__(self, **inputs):
        self.block.call(**inputs)

    def __getattr__(self, name):
        return getattr(self.block.variables, name)


class Program(FunctionBlock):
    """A PROGRAM, called once each scan; the function block of its text, if there is one, is what its instance is of."""

    kind = "program_declaration"

    def __init__(self, text, blocks=None):
        own = {_text(block.child_by_field_name("name")): lambda: Instance(text)
               for block in found(parse(text), "function_block_declaration")}
        super().__init__(text, own | (blocks or {}))


def _declared(block, blocks):
    for declaration in found(block, "variable_declaration"):
        type_ = _text(declaration.child_by_field_name("type"))
        if type_ in blocks:
            yield _text(declaration.child_by_field_name("names")), blocks[type_]()
            continue
        initial = declaration.child_by_field_name("initial_value")
        value = ZERO[type_] if initial is None else _initial(type_, _text(initial))
        for name in declaration.children_by_field_name("names"):
            yield _text(name), value


def _ms(text):
    """Return a duration literal in ms, of one unit."""
    number = text.lower().removeprefix("t#")
    return int(number[:-2]) if number.endswith("ms") else 1000 * int(number.removesuffix("s"))


def _initial(type_, text):
    return text == "TRUE" if type_ == "BOOL" else type(ZERO[type_])(float(text))


def _text(node):
    return node.text.decode()


def _statements(nodes, depth):
    lines = [line for node in nodes if node.is_named for line in _statement(node, depth)]
    return lines or [f"{'  ' * depth}pass"]


def _statement(node, depth):
    space = "  " * depth
    match node.type:
        case "comment" | "empty_statement":
            return []
        case "assignment_statement":
            target, value = (_expression(node.child_by_field_name(side)) for side in ("left", "right"))
            return [f"{space}{target} = {value}"]
        case "invocation_statement":
            call = node.named_children[0]
            inputs = [f"{_text(each.child_by_field_name('name'))}={_expression(each.child_by_field_name('value'))}"
                      for each in call.child_by_field_name("arguments").named_children]
            return [f"{space}{_expression(call.child_by_field_name('function'))}({', '.join(inputs)})"]
        case "if_statement":
            lines = [f"{space}if {_expression(node.child_by_field_name('condition'))}:"]
            lines += _statements(node.children_by_field_name("consequence"), depth + 1)
            for clause in node.children:
                if clause.type == "elsif_clause":
                    lines.append(f"{space}elif {_expression(clause.child_by_field_name('condition'))}:")
                elif clause.type == "else_clause":
                    lines.append(f"{space}else:")
                else:
                    continue
                lines += _statements(clause.children_by_field_name("body"), depth + 1)
            return lines
    raise NotImplementedError(node.type)


def _expression(node):
    def of(field):
        return _expression(node.child_by_field_name(field))

    def call():
        function = _text(node.child_by_field_name("function"))
        assert function in FUNCTIONS, function
        arguments = [_expression(each) for each in node.child_by_field_name("arguments").named_children]
        return f"{function}({', '.join(arguments)})"

    def sign(place):
        text = _text(node.children[place])
        return WORDS.get(text, text)

    kinds = {
        "identifier": lambda: f"v.{_text(node)}",
        "real_literal": lambda: f"real({_text(node)})",
        "integer_literal": lambda: _text(node),
        "time_literal": lambda: str(_ms(_text(node))),
        "boolean_literal": lambda: _text(node).title(),
        "parenthesized_expression": lambda: f"({_expression(node.named_children[0])})",
        "unary_expression": lambda: f"({sign(0)}{of('operand')})",
        "binary_expression": lambda: (f"divided({of('left')}, {of('right')})" if sign(1) == "/" else
                                      f"({of('left')} {sign(1)} {of('right')})"),
        "member_access_expression": lambda: f"{of('object')}.{_text(node.child_by_field_name('member'))}",
        "call_expression": call,
    }
    return kinds[node.type]()
